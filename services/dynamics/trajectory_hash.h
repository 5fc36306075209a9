#pragma once
/// A fingerprint of a whole trajectory that can be saved and continued.

#include <openssl/evp.h>

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace hamel::dynamics {

/// h_0 = 0, h_{k+1} = SHA-256(h_k, step, q, p): one changed bit in any step changes it, and 32 bytes carry it
/// over a restart.  Bytes are those of the machine (little endian).
class TrajectoryHash {
 public:
  using Digest = std::array<unsigned char, 32>;

  void add(std::uint64_t step, const Eigen::VectorXd& q, const Eigen::VectorXd& p) {
    EVP_DigestInit_ex(ctx_.get(), EVP_sha256(), nullptr);
    EVP_DigestUpdate(ctx_.get(), digest_.data(), digest_.size());
    EVP_DigestUpdate(ctx_.get(), &step, sizeof step);
    EVP_DigestUpdate(ctx_.get(), q.data(), static_cast<std::size_t>(q.size()) * sizeof(double));
    EVP_DigestUpdate(ctx_.get(), p.data(), static_cast<std::size_t>(p.size()) * sizeof(double));
    EVP_DigestFinal_ex(ctx_.get(), digest_.data(), nullptr);
  }

  const Digest& digest() const { return digest_; }
  void restore(const Digest& d) { digest_ = d; }

  std::string hex() const {
    static constexpr char kDigits[] = "0123456789abcdef";
    std::string s;
    for (const unsigned char b : digest_) {
      s += kDigits[b >> 4];
      s += kDigits[b & 15];
    }
    return s;
  }

 private:
  Digest digest_{};
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> ctx_{EVP_MD_CTX_new(), &EVP_MD_CTX_free};
};

}  // namespace hamel::dynamics
