#include "common/bus/cyclone_config.h"

namespace hamel::bus::cyclone {

namespace {

std::string element(const std::string& name, const std::string& inside) {
  return "<" + name + ">" + inside + "</" + name + ">";
}
std::string element(const std::string& name, std::chrono::milliseconds ms) {
  return element(name, std::to_string(ms.count()) + "ms");
}

/// DDS Security by the files of an identity.  Debian keeps the plugins where the loader does not look.
constexpr const char* kPlugins = CYCLONEDDS_PLUGINS;
std::string security(const Identity& identity) {
  const auto file = [](const std::string& name, const std::string& path) {
    return element(name, "file:" + path);
  };
  const auto plugin = [](const std::string& library, const std::string& function) {
    return "<Library path=\"" + std::string(kPlugins) + "/libdds_security_" + library +
           ".so\" initFunction=\"init_" + function + "\" finalizeFunction=\"finalize_" + function + "\"/>";
  };
  return element(
      "Security",
      element("Authentication", plugin("auth", "authentication") + file("IdentityCA", identity.ca) +
                                    file("IdentityCertificate", identity.certificate) +
                                    file("PrivateKey", identity.key)) +
          element("Cryptographic", plugin("crypto", "crypto")) +
          element("AccessControl",
                  plugin("ac", "access_control") + file("PermissionsCA", identity.permissions_ca) +
                      file("Governance", identity.governance) + file("Permissions", identity.permissions)));
}

}  // namespace

std::string configuration(const NodeOptions& options, const Interface& interface) {
  const auto peers = unicast_peers(options, interface);
  std::string list;
  for (const std::string& peer : peers) list += "<Peer Address=\"" + peer + "\"/>";
  const std::string general =
      element("Interfaces", "<NetworkInterface address=\"" + interface.address + "\"/>") +
      element("AllowMulticast", peers.empty() ? "spdp" : "false");
  // Cyclone tries indices below the maximum.
  const std::string discovery = element("ParticipantIndex", "auto") +
                                element("MaxAutoParticipantIndex", std::to_string(kMaxParticipantIndex + 1)) +
                                element("LeaseDuration", kLease) + element("SPDPInterval", kAnnouncement) +
                                element("Peers", list);
  const std::string secured =
      options.security.empty() ? "" : security(find_identity(options.security).value());
  // A writer waits for slow readers above this mark; keep-last already bounds what it holds.
  // Without the hash of a key, Fast DDS takes what ends an instance for the end of another (see from_key).
  const std::string internal =
      element("Watermarks", element("WhcHigh", "1GB")) + element("GenerateKeyhash", "true");
  return element("CycloneDDS",
                 element("Domain", element("General", general) + element("Discovery", discovery) +
                                       element("Internal", internal) + secured));
}

}  // namespace hamel::bus::cyclone
