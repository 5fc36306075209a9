#pragma once
/// Fast DDS's view of a payload: bytes that pass through, with the key it needs.  Private to fastdds.cpp.

#include <fastrtps/utils/md5.h>
#include <fastdds/dds/topic/TopicDataType.hpp>

#include "common/bus/payload.h"

namespace hamel::bus {

/// What Fast DDS calls the data: on writing the caller's bytes, on reading where to put them.
struct RawSample {
  std::span<const std::byte> out;
  Payload* in = nullptr;
  std::size_t size = 0;  ///< of what was read, even where it was too large to be kept
};

class PassThroughType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit PassThroughType(const Topic& topic) : topic_(topic) {
    setName(std::string(topic.type).c_str());
    m_typeSize =
        static_cast<std::uint32_t>(std::min(topic.max_bytes, std::size_t{1024}));  // a first guess; grows
    m_isGetKeyDefined = topic.keyed;
    auto_fill_type_object(false);
    auto_fill_type_information(false);
  }

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override {
    const auto bytes = static_cast<RawSample*>(data)->out;
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = little_endian(bytes) ? CDR_LE : CDR_BE;
    return true;
  }

  /// Never fails, so that what is refused is refused and counted in one place: take().
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override {
    auto& sample = *static_cast<RawSample*>(data);
    sample.size = payload->length;
    const std::size_t kept = sample.size <= topic_.max_bytes ? sample.size : kHeaderBytes + kKeyBytes;
    const auto* bytes = reinterpret_cast<const std::byte*>(payload->data);
    sample.in->assign(bytes, bytes + kept);
    sample.out = *sample.in;
    return true;
  }

  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<RawSample*>(data)->out.size()); };
  }

  /// RTPS 9.6.3.8: a key of at most 16 bytes is its own hash, big endian, padded with zeros.
  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle, bool force_md5) override {
    const auto bytes = static_cast<RawSample*>(data)->out;
    const std::uint32_t key = bytes.size() < kHeaderBytes + kKeyBytes ? 0 : key_of(bytes);
    eprosima::fastrtps::rtps::octet big_endian[16] = {};
    for (unsigned i = 0; i < kKeyBytes; ++i)
      big_endian[i] = static_cast<eprosima::fastrtps::rtps::octet>(key >> (24 - 8 * i));
    MD5 md5;
    if (force_md5) {
      md5.init();
      md5.update(big_endian, kKeyBytes);
      md5.finalize();
    }
    for (unsigned i = 0; i < 16; ++i) handle->value[i] = force_md5 ? md5.digest[i] : big_endian[i];
    return true;
  }

  void* createData() override {
    auto owned = std::make_unique<Owned>();
    owned->in = &owned->payload;
    return static_cast<RawSample*>(owned.release());
  }
  void deleteData(void* data) override { delete static_cast<Owned*>(static_cast<RawSample*>(data)); }

 private:
  /// A sample Fast DDS makes for itself, to find the key of what it received.
  struct Owned : RawSample {
    Payload payload;
  };

  const Topic& topic_;
};

}  // namespace hamel::bus
