#include "common/bus/cyclone_sertype.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string>

#include "common/bus/network.h"
#include "common/bus/payload.h"
#include "dds/ddsi/ddsi_sertype.h"
#include "dds/ddsi/q_radmin.h"
#include "dds/ddsrt/md5.h"
#include "dds/ddsrt/mh3.h"

namespace hamel::bus::cyclone {

bool Keys::admits(std::uint32_t key) {
  const std::lock_guard lock(mutex_);
  if (instances_.size() < kMaxInstances || instances_.contains(key)) return true;
  ++dropped_;
  return false;
}
void Keys::add(std::uint32_t key) {
  const std::lock_guard lock(mutex_);
  ++instances_[key];
}
void Keys::remove(std::uint32_t key) {
  const std::lock_guard lock(mutex_);
  if (const auto known = instances_.find(key); --known->second == 0) instances_.erase(known);
}

namespace {

static_assert(alignof(Sample) <= alignof(std::max_align_t));

struct Type : ddsi_sertype {
  const Topic* topic;
  std::shared_ptr<Keys> keys = std::make_shared<Keys>();
};

const Topic& topic_of(const ddsi_sertype* type) { return *static_cast<const Type*>(type)->topic; }
const Sample& sample(const ddsi_serdata* d) { return *static_cast<const Sample*>(d); }

constexpr std::size_t kKeySample = kHeaderBytes + kKeyBytes;

constexpr std::size_t padded(std::size_t n) { return (n + 3) / 4 * 4; }

std::array<std::byte, kKeyBytes> big_endian(std::uint32_t key) {
  return {static_cast<std::byte>(key >> 24), static_cast<std::byte>(key >> 16),
          static_cast<std::byte>(key >> 8), static_cast<std::byte>(key)};
}

/// A sample of `size` bytes that stand for `claimed`; the padding is zero, the rest is the caller's.
Sample* make(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size, std::size_t claimed) {
  void* block = std::malloc(sizeof(Sample) + padded(size));
  if (block == nullptr) return nullptr;
  auto* s = new (block) Sample;
  ddsi_serdata_init(s, type, kind);
  s->keys = static_cast<const Type*>(type)->keys;
  s->key = 0;
  s->size = static_cast<std::uint32_t>(padded(size));
  s->claimed = static_cast<std::uint32_t>(claimed);
  std::memset(s->bytes() + size, 0, padded(size) - size);
  return s;
}

/// Reads the key and its hash; a sample too short to have one gets key 0 and is refused when it is taken.
ddsi_serdata* finish(Sample* s) {
  if (topic_of(s->type).keyed && s->size >= kKeySample) s->key = key_of(s->payload());
  const auto key = big_endian(s->key);
  s->hash = ddsrt_mh3(key.data(), key.size(), 0) ^ s->type->serdata_basehash;
  return s;
}

/// Null where the key is one too many: Cyclone passes over the sample.
ddsi_serdata* admitted(ddsi_serdata* d) {
  if (d == nullptr || !topic_of(d->type).keyed || sample(d).keys->admits(sample(d).key)) return d;
  ddsi_serdata_unref(d);
  return nullptr;
}

/// How many of `size` incoming bytes are kept: a sample over the topic's bound is cut to its key.
std::size_t kept(const ddsi_sertype* type, std::size_t size) {
  return size <= topic_of(type).max_bytes ? size : std::min(size, kKeySample);
}

/// Copies the fragments of a received sample; they may overlap.
ddsi_serdata* from_fragments(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment,
                             std::size_t size) {
  Sample* s = make(type, kind, kept(type, size), size);
  if (s == nullptr) return nullptr;
  const auto end = static_cast<std::uint32_t>(kept(type, size));
  std::uint32_t at = 0;
  for (; fragment != nullptr && at < end; fragment = fragment->nextfrag) {
    if (fragment->maxp1 <= at) continue;
    const auto* from = reinterpret_cast<const unsigned char*>(
        NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment)));
    const std::uint32_t until = std::min(fragment->maxp1, end);
    std::memcpy(s->bytes() + at, from + (at - fragment->min), until - at);
    at = until;
  }
  return admitted(finish(s));
}

ddsi_serdata* from_vectors(const ddsi_sertype* type, ddsi_serdata_kind kind, ddsrt_msg_iovlen_t n,
                           const ddsrt_iovec_t* vectors, std::size_t size) {
  Sample* s = make(type, kind, kept(type, size), size);
  if (s == nullptr) return nullptr;
  std::size_t at = 0;
  const std::size_t end = kept(type, size);
  for (std::size_t i = 0; i < n && at < end; ++i) {
    const std::size_t part = std::min<std::size_t>(vectors[i].iov_len, end - at);
    std::memcpy(s->bytes() + at, vectors[i].iov_base, part);
    at += part;
  }
  return admitted(finish(s));
}

/// A key alone, as it stands in dispose messages.  Fast DDS 2.9 takes one of up to 16 bytes, header and all,
/// for the key's hash, and so for another instance; what is longer it passes over, and looks at the hash that
/// stands beside it (GenerateKeyhash).
ddsi_serdata* from_key(const ddsi_sertype* type, std::span<const std::byte, kKeyBytes> key) {
  constexpr std::size_t kLonger = 20;
  Sample* s = make(type, SDK_KEY, kLonger, kLonger);
  if (s == nullptr) return nullptr;
  std::memset(s->bytes(), 0, kLonger);  // the header's 0, 0: big endian
  std::memcpy(s->bytes() + kHeaderBytes, key.data(), kKeyBytes);
  return finish(s);
}

ddsi_serdata* from_keyhash(const ddsi_sertype* type, const ddsi_keyhash* hash) {
  return admitted(from_key(type, std::as_bytes(std::span(hash->value)).first<kKeyBytes>()));
}

ddsi_serdata* from_sample(const ddsi_sertype* type, ddsi_serdata_kind kind, const void* data) {
  const auto bytes = *static_cast<const std::span<const std::byte>*>(data);
  if (kind != SDK_DATA)
    return bytes.size() < kKeySample ? nullptr : from_key(type, big_endian(key_of(bytes)));
  Sample* s = make(type, kind, bytes.size(), bytes.size());
  if (s == nullptr) return nullptr;
  std::memcpy(s->bytes(), bytes.data(), bytes.size());
  return finish(s);
}

/// Cyclone makes one of these for each instance, and frees it with the instance.
ddsi_serdata* to_untyped(const ddsi_serdata* d) {
  ddsi_serdata* s = from_key(d->type, big_endian(sample(d).key));
  if (s == nullptr) return s;
  s->type = nullptr;
  sample(d).keys->add(sample(d).key);
  return s;
}

void free_sample(ddsi_serdata* d) {
  auto* s = static_cast<Sample*>(d);
  if (s->type == nullptr) s->keys->remove(s->key);
  s->~Sample();
  std::free(s);
}

void get_keyhash(const ddsi_serdata* d, ddsi_keyhash* hash, bool force_md5) {
  const auto key = big_endian(sample(d).key);
  std::memset(hash->value, 0, sizeof hash->value);
  std::memcpy(hash->value, key.data(), key.size());
  if (!force_md5) return;
  ddsrt_md5_state_t md5;
  ddsrt_md5_init(&md5);
  ddsrt_md5_append(&md5, reinterpret_cast<const ddsrt_md5_byte_t*>(key.data()), kKeyBytes);
  ddsrt_md5_finish(&md5, hash->value);
}

ddsi_serdata_ops sample_ops() {
  ddsi_serdata_ops ops{};
  ops.eqkey = [](const ddsi_serdata* a, const ddsi_serdata* b) {
    return sample(a).key == sample(b).key && sample(a).keys == sample(b).keys;
  };
  ops.get_size = [](const ddsi_serdata* d) { return sample(d).size; };
  ops.from_ser = from_fragments;
  ops.from_ser_iov = from_vectors;
  ops.from_keyhash = from_keyhash;
  ops.from_sample = from_sample;
  ops.to_ser = [](const ddsi_serdata* d, std::size_t at, std::size_t n, void* to) {
    std::memcpy(to, sample(d).bytes() + at, n);
  };
  ops.to_ser_ref = [](const ddsi_serdata* d, std::size_t at, std::size_t n, ddsrt_iovec_t* v) {
    v->iov_base = const_cast<std::byte*>(sample(d).bytes()) + at;
    v->iov_len = n;
    return ddsi_serdata_ref(d);
  };
  ops.to_ser_unref = [](ddsi_serdata* d, const ddsrt_iovec_t*) { ddsi_serdata_unref(d); };
  ops.to_sample = [](const ddsi_serdata*, void*, void**, void*) { return false; };  // taken as it is
  ops.to_untyped = to_untyped;
  ops.untyped_to_sample = [](const ddsi_sertype*, const ddsi_serdata*, void*, void**, void*) {
    return false;
  };
  ops.free = free_sample;
  ops.print = [](const ddsi_sertype*, const ddsi_serdata* d, char* text, std::size_t n) {
    return static_cast<std::size_t>(
        std::snprintf(text, n, "%u bytes, key %u", sample(d).size, sample(d).key));
  };
  ops.get_keyhash = get_keyhash;
  return ops;
}

ddsi_sertype_ops type_ops() {
  ddsi_sertype_ops ops{};
  ops.version = ddsi_sertype_v0;
  ops.free = [](ddsi_sertype* t) {
    ddsi_sertype_fini(t);
    delete static_cast<Type*>(t);
  };
  ops.zero_samples = [](const ddsi_sertype*, void*, std::size_t) {};
  ops.realloc_samples = [](void** to, const ddsi_sertype*, void*, std::size_t, std::size_t n) {
    std::fill_n(to, n, nullptr);
  };
  ops.free_samples = [](const ddsi_sertype*, void**, std::size_t, dds_free_op_t) {};
  ops.equal = [](const ddsi_sertype* a, const ddsi_sertype* b) {
    const Topic &s = topic_of(a), &t = topic_of(b);
    return s.type == t.type && s.keyed == t.keyed && s.max_bytes == t.max_bytes;
  };
  ops.hash = [](const ddsi_sertype* t) {
    const std::string_view name = topic_of(t).type;
    return ddsrt_mh3(name.data(), name.size(), 0);
  };
  return ops;
}

}  // namespace

CycloneTopic create_topic(dds_entity_t participant, const Topic& topic) {
  static const ddsi_serdata_ops of_samples = sample_ops();
  static const ddsi_sertype_ops of_type = type_ops();
  auto* type = new Type{};
  type->topic = &topic;
  ddsi_sertype_init(type, std::string(topic.type).c_str(), &of_type, &of_samples, !topic.keyed);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  ddsi_sertype* handed_over = type;
  const dds_entity_t made = dds_create_topic_sertype(participant, std::string(topic.name).c_str(),
                                                     &handed_over, nullptr, nullptr, nullptr);
  if (made < 0) {
    ddsi_sertype_unref(type);
    return {made, nullptr};
  }
  return {made, static_cast<const Type*>(handed_over)->keys};  // of a type that was there before, perhaps
}

}  // namespace hamel::bus::cyclone
