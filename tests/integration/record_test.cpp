/// MCAP files of ours: what is written is read, and what was cut or changed is said and passed over.

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "common/record/reader.h"
#include "common/record/writer.h"

using namespace hamel::record;
using namespace std::chrono_literals;

namespace {

constexpr Compression kAll[] = {Compression::none, Compression::lz4, Compression::zstd};

std::string path(const std::string& name) {
  return testing::TempDir() + "/hamel_record_" + std::to_string(getpid()) + "_" + name + ".mcap";
}

/// Message i of a file: its channel, time and content follow from i.
struct Sample {
  std::uint16_t channel;
  std::uint64_t time;
  std::string data;
  bool operator==(const Sample&) const = default;
};
Sample sample(std::uint32_t i) {
  std::string data(i % 97, static_cast<char>('a' + i % 26));
  data += std::to_string(i);
  return {static_cast<std::uint16_t>(1 + i % 3), i * 1000ull + (i % 3 == 2 ? 7000 : 0), data};
}

std::unique_ptr<Writer> begin(const std::string& file, Compression c) {
  auto w = Writer::create(file, {.compression = c, .chunk_bytes = 2000});
  EXPECT_TRUE(w);
  Writer& out = *w.value();
  EXPECT_TRUE(out.write(Attachment{1, 2, "robot.urdf", "application/xml", "<robot/>"}));
  EXPECT_TRUE(out.write(Metadata{"hamel", {{"version", "0.1"}, {"empty", ""}}}));
  for (int k = 0; k < 3; ++k) {
    const auto id = out.add(Schema{0, "type" + std::to_string(k), "omgidl", "struct S {};"});
    out.add(Channel{0, id, "topic" + std::to_string(k), "cdr", {{"delivery", "stream"}}});
  }
  return std::move(w).value();
}

void write_file(const std::string& file, Compression c, std::uint32_t n) {
  const auto w = begin(file, c);
  for (std::uint32_t i = 0; i < n; ++i) {
    const Sample s = sample(i);
    EXPECT_TRUE(w->write(Message{s.channel, i, s.time, s.time, std::as_bytes(std::span(s.data))}, {}));
  }
  EXPECT_TRUE(w->close());
}

struct Contents {
  std::vector<Sample> messages;
  std::size_t attachments = 0, metadata = 0;
  std::vector<Damage> damages;
  bool complete = false;

  void add(const Item& item) {
    if (const auto* m = std::get_if<Message>(&item))
      messages.push_back(
          {m->channel, m->log_time, {reinterpret_cast<const char*>(m->data.data()), m->data.size()}});
    attachments += std::holds_alternative<Attachment>(item);
    metadata += std::holds_alternative<Metadata>(item);
    if (const auto* d = std::get_if<Damage>(&item)) damages.push_back(*d);
  }
};

/// Everything the stream reader gives; a file that is not MCAP at all gives one damage.
Contents read(const std::string& file) {
  Contents c;
  auto r = StreamReader::open(file);
  if (!r) {
    c.damages.push_back({0, r.error().what});
    return c;
  }
  while (const auto item = r.value().next()) c.add(*item);
  c.complete = r.value().complete();
  return c;
}

std::string load(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
void store(const std::string& file, const std::string& bytes) {
  std::filesystem::remove(file);  // a file that is cut to nothing and written again is forced to the disk
  std::ofstream(file, std::ios::binary | std::ios::trunc)
      .write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

class EveryCompression : public testing::TestWithParam<Compression> {};
INSTANTIATE_TEST_SUITE_P(Record, EveryCompression, testing::ValuesIn(kAll), [](const auto& i) {
  return *name_in_file(i.param) ? std::string(name_in_file(i.param)) : std::string("none");
});

TEST_P(EveryCompression, WhatIsWrittenIsReadInTheOrderItWasWritten) {
  const std::string file = path("round");
  write_file(file, GetParam(), 1000);
  const Contents c = read(file);
  EXPECT_TRUE(c.damages.empty());
  EXPECT_TRUE(c.complete);
  EXPECT_EQ(c.attachments, 1u);
  EXPECT_EQ(c.metadata, 1u);
  ASSERT_EQ(c.messages.size(), 1000u);
  for (std::uint32_t i = 0; i < 1000; ++i) ASSERT_EQ(c.messages[i], sample(i)) << i;
}

TEST_P(EveryCompression, TheIndexGivesLogTimeOrderAndOnlyWhatIsAsked) {
  const std::string file = path("index");
  write_file(file, GetParam(), 1000);
  auto r = IndexedReader::open(file);
  ASSERT_TRUE(r);
  IndexedReader& in = r.value();
  EXPECT_EQ(in.summary().statistics->messages, 1000u);
  EXPECT_EQ(in.summary().channels.size(), 3u);
  ASSERT_EQ(in.summary().attachments.size(), 1u);
  EXPECT_EQ(in.attachment(in.summary().attachments[0]).value().data, "<robot/>");
  EXPECT_EQ(in.metadata(in.summary().metadata[0]).value().entries[0].second, "0.1");

  Contents all;
  while (const auto item = in.next()) all.add(*item);
  EXPECT_TRUE(all.damages.empty());
  ASSERT_EQ(all.messages.size(), 1000u);
  for (std::size_t i = 1; i < 1000; ++i) ASSERT_LE(all.messages[i - 1].time, all.messages[i].time) << i;

  in.seek({.topics = {"topic1"}, .begin = 100000, .end = 200000});
  Contents some;
  while (const auto item = in.next()) some.add(*item);
  std::vector<Sample> expected;
  for (std::uint32_t i = 0; i < 1000; ++i)
    if (const Sample s = sample(i); s.channel == 2 && s.time >= 100000 && s.time <= 200000)
      expected.push_back(s);
  EXPECT_EQ(some.messages, expected);
}

TEST_P(EveryCompression, CutAnywhereItGivesEveryCompleteChunk) {
  const std::string file = path("whole"), cut = path("cut"), mended = path("mended");
  write_file(file, GetParam(), 600);
  const std::string bytes = load(file);
  const auto index = IndexedReader::open(file);
  ASSERT_TRUE(index);
  std::vector<std::size_t> in_chunk;
  for (const ChunkIndex& c : index.value().summary().chunks) {
    in_chunk.push_back(0);
    for (const auto& [channel, at] : c.channels)
      in_chunk.back() +=
          (static_cast<unsigned char>(bytes[at + 12]) * 256u + static_cast<unsigned char>(bytes[at + 11])) /
          16;
  }
  std::mt19937 random(6);
  for (int k = 0; k < 1000; ++k) {
    const std::size_t n = random() % bytes.size();
    store(cut, bytes.substr(0, n));
    std::size_t least = 0;  // messages in chunks before the cut
    for (std::size_t i = 0; i < index.value().summary().chunks.size(); ++i) {
      const ChunkIndex& c = index.value().summary().chunks[i];
      if (c.offset + c.length <= n) least += in_chunk[i];
    }
    const Contents found = read(cut);
    EXPECT_FALSE(found.complete);
    ASSERT_FALSE(found.damages.empty()) << n;
    ASSERT_EQ(found.messages.size(), least) << n;
    for (std::uint32_t i = 0; i < found.messages.size(); ++i) ASSERT_EQ(found.messages[i], sample(i)) << n;
    std::filesystem::remove(mended);
    const auto r = recover(cut, mended, GetParam());
    if (!r) {
      EXPECT_LT(n, kMagic.size());
      continue;
    }
    EXPECT_EQ(r.value().messages, found.messages.size());
    const Contents again = read(mended);
    EXPECT_TRUE(again.complete);
    EXPECT_TRUE(again.damages.empty());
    EXPECT_EQ(again.messages, found.messages);
    EXPECT_TRUE(IndexedReader::open(mended));
  }
}

TEST_P(EveryCompression, AFlippedBitIsSaidAndTheRestIsRead) {
  const std::string file = path("sound"), bad = path("flipped");
  write_file(file, GetParam(), 600);
  const std::string bytes = load(file);
  std::mt19937 random(7);
  std::size_t most_lost = 0;
  for (int k = 0; k < 1000; ++k) {
    std::string changed = bytes;
    const std::size_t at = random() % bytes.size();
    changed[at] = static_cast<char>(changed[at] ^ (1 << random() % 8));
    store(bad, changed);
    const Contents found = read(bad);
    ASSERT_FALSE(found.damages.empty()) << "at " << at;
    std::uint32_t next = 0;  // what is read is what was written, in order; a part may be missing
    for (const Sample& s : found.messages) {
      while (next < 600 && !(sample(next) == s)) ++next;
      ASSERT_LT(next, 600u) << "at " << at;
      ++next;
    }
    most_lost = std::max(most_lost, 600 - found.messages.size());
    if (auto r = IndexedReader::open(bad)) {
      Contents by_index;
      while (const auto item = r.value().next()) by_index.add(*item);
      EXPECT_LE(by_index.messages.size(), 600u);
    }
  }
  EXPECT_LE(most_lost, 60u) << "one chunk";
}

TEST_P(EveryCompression, AFlippedBitOfTheMagicCostsNothing) {
  const std::string file = path("sound"), bad = path("flipped");
  write_file(file, GetParam(), 600);
  const Contents sound = read(file);
  ASSERT_GT(sound.attachments, 0u);
  for (std::size_t at = 0; at < 8; ++at) {
    std::string changed = load(file);
    changed[at] = static_cast<char>(changed[at] ^ 4);
    store(bad, changed);
    const Contents found = read(bad);
    EXPECT_FALSE(found.damages.empty());
    EXPECT_EQ(found.messages.size(), 600u);
    EXPECT_EQ(found.attachments, sound.attachments);
  }
}

TEST_P(EveryCompression, ARecoveredFileRemembersItsHole) {
  const std::string file = path("sound"), bad = path("holed"), out = path("mended");
  write_file(file, GetParam(), 600);
  const std::string bytes = load(file);
  const Contents sound = read(file);
  const auto metadata_after = [&](const std::string& changed) {
    store(bad, changed);
    EXPECT_TRUE(recover(bad, out, GetParam()));
    return read(out).metadata;
  };
  const auto chunks = IndexedReader::open(file).value().summary().chunks;
  ASSERT_GE(chunks.size(), 3u);
  const std::size_t within = chunks[chunks.size() / 2].offset + 60;
  std::string holed = bytes;
  holed[within] = static_cast<char>(holed[within] ^ 1);
  EXPECT_EQ(metadata_after(holed), sound.metadata + 1);
  const std::size_t of_cut = metadata_after(bytes.substr(0, within));
  EXPECT_EQ(of_cut, read(bad).metadata) << "a cut file has no hole";
}

TEST_P(EveryCompression, AnyBytesAreReadWithoutACrash) {
  const std::string file = path("seed"), bad = path("noise");
  write_file(file, GetParam(), 100);
  const std::string bytes = load(file);
  std::mt19937 random(8);
  for (int k = 0; k < 500; ++k) {
    std::string changed = bytes;
    for (std::size_t i = 1 + random() % 40; i > 0; --i)
      changed[8 + random() % (bytes.size() - 8)] = static_cast<char>(random());
    store(bad, changed);
    const Contents found = read(bad);
    EXPECT_LE(found.messages.size(), 100u);
    (void)recover(bad, path("noise_out"), GetParam());
  }
}

TEST(Record, AChunkGoesOutWhenItIsOldEnough) {
  const std::string file = path("clock");
  auto w = Writer::create(file, {.flush_every = 1000ms});
  ASSERT_TRUE(w);
  Writer& out = *w.value();
  out.add(Schema{0, "s", "omgidl", ""});
  const auto channel = out.add(Channel{0, 1, "t", "cdr", {}});
  const auto began = out.bytes();
  const Writer::Time t0{};
  out.write(Message{channel, 0, 1, 1, {}}, t0);
  out.write(Message{channel, 1, 2, 2, {}}, t0 + 999ms);
  EXPECT_EQ(out.bytes(), began);
  out.tick(t0 + 1000ms);
  EXPECT_GT(out.bytes(), began);
  EXPECT_EQ(read(file).messages.size(), 2u) << "a killed recorder leaves them";
}

TEST(Record, MemoryDoesNotGrowWithTheFile) {
  const std::string file = path("long");
  const auto w = Writer::create(file, {.chunk_bytes = 1});  // a chunk a message: a day of recording
  ASSERT_TRUE(w);
  Writer& out = *w.value();
  out.add(Schema{0, "s", "omgidl", ""});
  const auto channel = out.add(Channel{0, 1, "t", "cdr", {}});
  const auto write = [&](std::uint32_t begin, std::uint32_t end) {
    for (std::uint32_t i = begin; i < end; ++i) ASSERT_TRUE(out.write(Message{channel, i, i, i, {}}, {}));
  };
  write(0, 1000);
  const auto before = mallinfo2().uordblks;
  write(1000, 100'000);
  EXPECT_LT(mallinfo2().uordblks, before + 4096);
  EXPECT_TRUE(out.close());
  auto in = IndexedReader::open(file);
  ASSERT_TRUE(in);
  EXPECT_EQ(in.value().summary().chunks.size(), 100'000u);
  in.value().seek({.topics = {}, .begin = 77'777, .end = 77'777});
  const auto item = in.value().next();
  ASSERT_TRUE(item && std::holds_alternative<Message>(*item));
  EXPECT_EQ(std::get<Message>(*item).sequence, 77'777u);
}

TEST(Record, AFileThatIsNoneIsRefusedByName) {
  EXPECT_FALSE(StreamReader::open("/nowhere/x.mcap"));
  const std::string file = path("text");
  store(file, "t_s,id\n");
  const auto r = StreamReader::open(file);
  ASSERT_FALSE(r);
  EXPECT_EQ(hamel::to_string(r.error()), file + ": is no MCAP file");
  EXPECT_FALSE(IndexedReader::open(file));
  EXPECT_FALSE(StreamReader::open(testing::TempDir()));
}

TEST(Record, ARefusingDiskIsAProblemWithTheFilesName) {
  const auto w = Writer::create("/dev/full", {});
  ASSERT_FALSE(w);
  EXPECT_NE(hamel::to_string(w.error()).find("/dev/full: cannot write on: No space left"), std::string::npos);
}

TEST(Record, RecordsOfALaterVersionArePassedOver) {
  const std::string file = path("future");
  write_file(file, Compression::none, 10);
  std::string bytes = load(file);
  Bytes extra;
  append_record(extra, static_cast<Op>(0x55), [](Out& o) { o.text("from the future"); });
  const std::size_t data = 8 + 9 + static_cast<unsigned char>(bytes[9]);  // behind the header
  bytes.insert(data, reinterpret_cast<const char*>(extra.data()), extra.size());
  store(file, bytes);
  EXPECT_EQ(read(file).messages.size(), 10u);
}

}  // namespace
