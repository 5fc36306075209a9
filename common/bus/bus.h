#pragma once
/// The bus: payloads in and out of named topics, over one of three vendors chosen at run time.
///
/// A payload is plain CDR with its 4-byte encapsulation header, exactly as it stands on the wire, so any
/// topic can be recorded without knowing its type.  The typed face is common/wire/endpoint.h.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/base/result.h"
#include "idl/topics.h"

namespace hamel::bus {

enum class Vendor : std::uint8_t { inproc, fastdds, cyclonedds };
const char* to_string(Vendor v);

using Payload = std::vector<std::byte>;

inline constexpr std::uint32_t kMaxDomain = 232;  ///< RTPS ports are 7400 + 250 * domain and up

struct NodeOptions {
  Vendor vendor = Vendor::inproc;
  std::uint32_t domain = 31;       ///< DDS domain, 0..232; inproc: a name space within the process
  std::string interface_name;      ///< network interface or address; empty: loopback only
  std::vector<std::string> peers;  ///< unicast addresses; empty: multicast where the interface has it
  std::string name = "hamel";      ///< shown by tools
  std::string discovery_server;    ///< "ADDRESS:PORT" of a Fast DDS discovery server; empty: none
  /// How long wait() stays awake before it sleeps (Cyclone DDS; for those who answer each other as fast as
  /// they can: it keeps a processor busy).
  std::chrono::microseconds awake{0};
  std::string security;  ///< folder of an identity made by deploy/security/make; empty: open
  /// Told in one sentence what a user should know (a peer's QoS that cannot match ours), each once.  Called
  /// by wait(), on the owner's thread; empty: nobody is told.
  std::function<void(const std::string&)> log;
};

/// Who wrote a sample: the RTPS GUID as it stands on the wire, the same for readers of either vendor; inproc:
/// a number of this process.
using WriterId = std::array<std::uint8_t, 16>;

/// What a reader asks of its writers.
enum class Ask : std::uint8_t {
  data,      ///< the data: matches every reliable writer, a foreign one with default QoS too
  promises,  ///< also to keep the topic's rate and to say that they live; what is missed is counted
  /// Of a stream, what comes by: nothing is repeated for it (best effort).  For those that stay a moment:
  /// Fast DDS's writers may stand still for ever when one leaves for whom they are repeating something.
  glimpse,
};

/// One end of a topic anywhere on the domain.
struct Endpoint {
  std::string topic = {}, type = {}, participant = {};  ///< participant: its name, where it gave one
  bool writes = false, reliable = false, latched = false, exclusive = false;
  /// Offered by a writer, asked for by a reader; 0: nothing is.
  std::chrono::microseconds deadline{}, liveliness{};
  WriterId id{};
};

/// What happened to one end of a topic since it was made.
struct Counters {
  std::uint64_t samples = 0;       ///< written or taken
  std::uint64_t lost = 0;          ///< the bus says it dropped these
  std::uint64_t refused = 0;       ///< larger than Topic::max_bytes, or an unknown encapsulation
  std::uint64_t incompatible = 0;  ///< peers whose QoS cannot match ours (each also logged once)
  std::uint64_t disposed = 0;      ///< keys whose writers took them back, or left (Fast DDS: unregistered)
  std::uint64_t late = 0;          ///< Ask::promises: periods of the topic's staleness without a sample
  std::uint64_t silent = 0;        ///< Ask::promises: times a writer stopped saying that it lives
};

class Writer {
 public:
  virtual ~Writer() = default;
  /// Sends a payload.  False when the bus refused it (counted).  Never waits for a reader.
  virtual bool write(std::span<const std::byte> payload) = 0;
  /// Takes the key of this payload back: late readers get it no more, readers count it as disposed.
  virtual bool dispose(std::span<const std::byte> payload) = 0;
  virtual WriterId id() const = 0;
  virtual int matched() const = 0;  ///< readers known now
  virtual Counters counters() const = 0;
};

class Reader {
 public:
  virtual ~Reader() = default;
  /// Moves the oldest waiting sample into `payload` (its capacity is reused).  False when none waits, or none
  /// was found among many that had to be refused (the node's wait() then returns at once).  Samples of one
  /// writer and key come in the order they were written; between keys DDS promises no order.
  virtual bool take(Payload& payload) = 0;
  /// The writer of the sample that take() gave last.
  virtual WriterId from() const = 0;
  virtual int matched() const = 0;  ///< writers known now
  virtual Counters counters() const = 0;
};

/// One participant.  Threads: wait() and take() belong to the owner's thread, wake() to any.  Writers and
/// readers must go before their node.
class Node {
 public:
  virtual ~Node() = default;
  /// Never null; std::runtime_error with one sentence when the vendor refuses (out of memory or sockets).
  /// `topic` must outlive the node: the constants of idl/topics.h do.
  virtual std::unique_ptr<Writer> writer(const Topic& topic) = 0;
  /// `depth` samples of each key wait for it, the newest; 0: as many as the topic's delivery says (a recorder
  /// wants more).
  virtual std::unique_ptr<Reader> reader(const Topic& topic, int depth = 0, Ask ask = Ask::data) = 0;
  /// The last sentence that was told to NodeOptions::log; empty: none.
  virtual std::string complaint() const = 0;
  /// The readers and writers of other participants on this domain, as far as they and their participants are
  /// known (inproc: all of the process).  Allocates; on the owner's thread.
  virtual std::vector<Endpoint> endpoints() = 0;
  /// How many times an end of this node met a peer whose QoS cannot match.
  virtual std::uint64_t incompatible() const = 0;
  /// Waits until a sample arrived or wake() was called since the last wait(), or until the deadline.
  /// True when woken.  Middleware threads only notify; user code runs here, on the owner's thread.
  virtual bool wait(std::chrono::steady_clock::time_point deadline) = 0;
  virtual void wake() noexcept = 0;
  virtual const NodeOptions& options() const = 0;
};

/// Opens a node, or says in one sentence what is wrong: interface absent or down, domain out of range, no
/// free participant index, vendor's own refusal.
Result<std::unique_ptr<Node>, Problem> open(const NodeOptions& options);

/// The version of the vendor's library that hamel was built with; inproc: empty.
std::string library_version(Vendor vendor);

/// "fastdds" -> Vendor; the error lists the names.
Result<Vendor, Problem> vendor_from(std::string_view name);

/// The vendor used where none is asked for by services in their own processes (chosen by measurement, see
/// common/bus/README.md).
inline constexpr Vendor kDefaultNetworkVendor = Vendor::cyclonedds;

}  // namespace hamel::bus
