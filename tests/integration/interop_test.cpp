/// Either bus of ours beside plain programs of either vendor, in both directions: keys, their ends, promises,
/// late readers.  The writer is a process of its own.  The table in common/bus/README.md says what holds.

#include "tests/integration/interop.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <map>
#include <thread>

#include "common/wire/endpoint.h"

namespace hamel {
namespace {

using bus::Vendor;
using test::Sight;
using namespace std::chrono_literals;

constexpr auto kDeadline = 20s;  // generous: a test that waits this long has failed

std::unique_ptr<bus::Node> open(Vendor vendor, unsigned domain) {
  bus::NodeOptions o;
  o.vendor = vendor;
  o.domain = domain;
  auto node = bus::open(o);
  if (!node) throw std::runtime_error(to_string(node.error()));
  return std::move(node).value();
}

void set_number(wire::Goal& m, std::uint32_t n) { m.id = n; }
void set_number(wire::TorqueCommand& m, std::uint32_t n) { m.step = n; }

template <class T>
class OurWriter final : public test::WriterEnd {
 public:
  OurWriter(Vendor vendor, unsigned domain)
      : node_(open(vendor, domain)), writer_(node_->writer(wire::topic_of<T>())) {}
  void write(std::uint32_t key, std::uint32_t number) override { writer_->write(sample(key, number)); }
  void dispose(std::uint32_t key) override { writer_->dispose(sample(key, 1)); }

 private:
  static bus::Payload sample(std::uint32_t key, std::uint32_t number) {
    T m;
    m.arm = key;
    set_number(m, number);
    bus::Payload p;
    wire::encode(m, p);
    return p;
  }
  std::unique_ptr<bus::Node> node_;
  std::unique_ptr<bus::Writer> writer_;
};

std::uint32_t number_in(const wire::Goal& m) { return static_cast<std::uint32_t>(m.id); }
std::uint32_t number_in(const wire::TorqueCommand& m) { return static_cast<std::uint32_t>(m.step); }

template <class T>
class OurReader final : public test::ReaderEnd {
 public:
  OurReader(Vendor vendor, unsigned domain)
      : node_(open(vendor, domain)), reader_(node_->reader(wire::topic_of<T>(), 0, bus::Ask::promises)) {}
  std::optional<Sight> take() override {
    const auto gone = reader_->counters().disposed;
    bus::Payload p;
    T m;
    if (gone_ < gone) return ++gone_, Sight{Sight::gone};
    if (!reader_->take(p)) return {};
    EXPECT_TRUE(wire::decode(p, m));
    return Sight{Sight::data, m.arm, number_in(m)};
  }
  int writers() override { return reader_->matched(); }
  int late() override { return static_cast<int>(reader_->counters().late); }
  int silent() override { return static_cast<int>(reader_->counters().silent); }

 private:
  std::unique_ptr<bus::Node> node_;
  std::unique_ptr<bus::Reader> reader_;
  std::uint64_t gone_ = 0;
};

struct Pair {
  bool we_write;
  Vendor writer, reader;
  unsigned domain;
};

std::unique_ptr<test::WriterEnd> make_writer(bool ours, Vendor vendor, const Topic& topic, unsigned domain) {
  if (!ours)
    return vendor == Vendor::fastdds ? test::fast_writer(topic, domain) : test::cyclone_writer(topic, domain);
  if (topic.name == topics::kGoal.name) return std::make_unique<OurWriter<wire::Goal>>(vendor, domain);
  return std::make_unique<OurWriter<wire::TorqueCommand>>(vendor, domain);
}
std::unique_ptr<test::ReaderEnd> make_reader(bool ours, Vendor vendor, const Topic& topic, unsigned domain) {
  if (!ours)
    return vendor == Vendor::fastdds ? test::fast_reader(topic, domain) : test::cyclone_reader(topic, domain);
  if (topic.name == topics::kGoal.name) return std::make_unique<OurReader<wire::Goal>>(vendor, domain);
  return std::make_unique<OurReader<wire::TorqueCommand>>(vendor, domain);
}

/// A writer in a process of its own: this program again, which does as it is told and leaves when nobody
/// tells it anything any more.
class Process {
 public:
  Process(const Pair& p, const Topic& topic)
      : told_(popen((std::filesystem::read_symlink("/proc/self/exe").string() + " writer " +
                     (p.we_write ? "ours " : "native ") + to_string(p.writer) + " " +
                     std::string(topic.name) + " " + std::to_string(p.domain))
                        .c_str(),
                    "w")) {}
  ~Process() { leave(); }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  void write(std::uint32_t key, std::uint32_t number) { tell("write", key, number); }
  void dispose(std::uint32_t key) { tell("dispose", key); }
  void unregister(std::uint32_t key) { tell("unregister", key); }
  void die() { tell("die", 0); }
  void leave() {
    if (told_) pclose(told_);
    told_ = nullptr;
  }

 private:
  void tell(const char* what, std::uint32_t key, std::uint32_t number = 0) {
    std::fprintf(told_, "%s %u %u\n", what, key, number);
    std::fflush(told_);
  }
  std::FILE* told_;
};

int obey(bool ours, Vendor vendor, const Topic& topic, unsigned domain) {
  const auto writer = make_writer(ours, vendor, topic, domain);
  std::string what;
  for (std::uint32_t key, number; std::cin >> what >> key >> number;) {
    if (what == "write") writer->write(key, number);
    if (what == "dispose") writer->dispose(key);
    if (what == "unregister") writer->unregister(key);
    if (what == "die") _exit(0);  // without a word to anyone
  }
  return 0;
}

class Interop : public testing::TestWithParam<Pair> {
 protected:
  std::unique_ptr<test::ReaderEnd> reader(const Topic& topic) {
    return make_reader(!GetParam().we_write, GetParam().reader, topic, GetParam().domain);
  }

  template <class Done>
  static bool wait_for(Done done) {
    const auto deadline = std::chrono::steady_clock::now() + kDeadline;
    while (!done()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      std::this_thread::sleep_for(2ms);  // of polling: not all ends can be waited for
    }
    return true;
  }
  /// Takes until each of `keys` has come with `number`.
  static bool comes(test::ReaderEnd& reader, std::vector<std::uint32_t> keys, std::uint32_t number) {
    std::map<std::uint32_t, std::uint32_t> last;
    return wait_for([&] {
      while (const auto s = reader.take())
        if (s->what == Sight::data) {
          EXPECT_TRUE(!last.contains(s->key) || last[s->key] < s->number) << "in order";
          last[s->key] = s->number;
        }
      return std::all_of(keys.begin(), keys.end(),
                         [&](auto k) { return last.contains(k) && last[k] == number; });
    });
  }
  static std::optional<Sight> wait_for_any(test::ReaderEnd& reader) {
    std::optional<Sight> s;
    wait_for([&] { return (s = reader.take()).has_value(); });
    return s;
  }
  /// The next that is not data.
  static std::optional<Sight> end_of_a_key(test::ReaderEnd& reader) {
    std::optional<Sight> s;
    wait_for([&] {
      s = reader.take();
      return s && s->what != Sight::data;
    });
    return s;
  }
};

constexpr std::uint32_t kKeys[] = {1, 2, 300, 0x12345678};

TEST_P(Interop, EachKeyHasItsOwnLastSample) {
  const auto reader = this->reader(topics::kGoal);
  Process writer(GetParam(), topics::kGoal);
  for (std::uint32_t number = 1; number <= 5; ++number)
    for (const auto key : kKeys) writer.write(key, number);
  EXPECT_TRUE(comes(*reader, {std::begin(kKeys), std::end(kKeys)}, 5));
}

TEST_P(Interop, ALateReaderGetsTheLastOfEachKeyThatIsLeft) {
  const auto early = this->reader(topics::kGoal);
  Process writer(GetParam(), topics::kGoal);
  for (std::uint32_t number = 1; number <= 5; ++number)
    for (const auto key : kKeys) writer.write(key, number);
  writer.dispose(2);
  ASSERT_TRUE(end_of_a_key(*early));
  const auto late = make_reader(!GetParam().we_write, GetParam().reader, topics::kGoal, GetParam().domain);
  std::vector<std::uint32_t> seen;
  ASSERT_TRUE(wait_for([&] {
    while (const auto s = late->take())
      if (s->what == Sight::data) {
        EXPECT_EQ(s->number, 5U);
        seen.push_back(s->key);
      }
    return seen.size() >= 3;
  }));
  std::sort(seen.begin(), seen.end());
  EXPECT_EQ(seen, (std::vector<std::uint32_t>{1, 300, 0x12345678}));
}

TEST_P(Interop, AKeyThatIsDisposedIsSeenToBe) {
  const auto reader = this->reader(topics::kGoal);
  Process writer(GetParam(), topics::kGoal);
  for (const auto key : kKeys) writer.write(key, 1);
  ASSERT_TRUE(comes(*reader, {std::begin(kKeys), std::end(kKeys)}, 1));
  writer.dispose(0x12345678);
  const auto seen = end_of_a_key(*reader);
  ASSERT_TRUE(seen);
  if (GetParam().we_write) {
    EXPECT_EQ(seen->what, Sight::disposed);
    EXPECT_EQ(seen->key, 0x12345678U);
  }
  writer.write(0x12345678, 7);  // and may come back
  EXPECT_TRUE(comes(*reader, {0x12345678}, 7));
}

/// Cyclone sends Fast DDS the end of a key in a form that it takes for another key's (cyclone_sertype.cpp):
/// what was disposed is counted all the same, what was unregistered is not.
TEST_P(Interop, AKeyThatIsUnregisteredIsSeenToBe) {
  if (GetParam().we_write) return;  // our writers keep a key, or dispose it
  const bool lost = GetParam().writer == Vendor::cyclonedds && GetParam().reader == Vendor::fastdds;
  const auto reader = this->reader(topics::kGoal);
  Process writer(GetParam(), topics::kGoal);
  writer.write(0x12345678, 1);
  ASSERT_TRUE(comes(*reader, {0x12345678}, 1));
  writer.unregister(0x12345678);
  if (!lost) {
    EXPECT_TRUE(end_of_a_key(*reader));
    return;
  }
  writer.write(2, 1);
  const auto next = wait_for_any(*reader);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->what, Sight::data) << "mended: say so in common/bus/README.md";
}

/// Fast DDS tells its reader only that there is a writer less, not that its keys have none.
TEST_P(Interop, AWriterThatLeavesIsMissed) {
  const auto reader = this->reader(topics::kGoal);
  Process writer(GetParam(), topics::kGoal);
  writer.write(0x12345678, 1);
  ASSERT_TRUE(comes(*reader, {0x12345678}, 1));
  EXPECT_EQ(reader->writers(), 1);
  writer.leave();
  EXPECT_TRUE(wait_for([&] { return reader->writers() == 0; }));
  if (GetParam().reader == Vendor::fastdds) return;
  const auto seen = end_of_a_key(*reader);
  ASSERT_TRUE(seen);
  if (GetParam().we_write) {
    EXPECT_EQ(seen->what, Sight::left);
    EXPECT_EQ(seen->key, 0x12345678U);
  }
}

TEST_P(Interop, AMissedDeadlineIsNoticed) {
  const auto reader = this->reader(topics::kCommand);
  Process writer(GetParam(), topics::kCommand);
  ASSERT_TRUE(wait_for([&] {
    writer.write(1, 1);
    return reader->take().has_value();
  }));
  EXPECT_TRUE(wait_for([&] { return reader->late() > 0; })) << "nothing for 50 ms";
}

TEST_P(Interop, AWriterThatDiesIsNoticed) {
  const auto reader = this->reader(topics::kGoal);
  Process writer(GetParam(), topics::kGoal);
  writer.write(1, 1);
  ASSERT_TRUE(comes(*reader, {1}, 1));
  EXPECT_EQ(reader->silent(), 0);
  writer.die();
  EXPECT_TRUE(wait_for([&] { return reader->silent() > 0; })) << "nothing for a second";
}

std::string name_of(const testing::TestParamInfo<Pair>& info) {
  const Pair& p = info.param;
  const std::string from = to_string(p.writer), to = to_string(p.reader);
  return p.we_write ? "our_" + from + "_to_" + to : from + "_to_our_" + to;
}

constexpr Vendor kFast = Vendor::fastdds, kCyclone = Vendor::cyclonedds;
INSTANTIATE_TEST_SUITE_P(Vendors, Interop,
                         testing::Values(Pair{true, kFast, kFast, 210}, Pair{true, kFast, kCyclone, 211},
                                         Pair{true, kCyclone, kFast, 212},
                                         Pair{true, kCyclone, kCyclone, 213}, Pair{false, kFast, kFast, 214},
                                         Pair{false, kFast, kCyclone, 215}, Pair{false, kCyclone, kFast, 216},
                                         Pair{false, kCyclone, kCyclone, 217}),
                         name_of);

}  // namespace
}  // namespace hamel

int main(int argc, char** argv) {
  using namespace hamel;
  if (argc == 6 && std::strcmp(argv[1], "writer") == 0)
    return obey(std::strcmp(argv[2], "ours") == 0, bus::vendor_from(argv[3]).value(),
                argv[4] == topics::kGoal.name ? topics::kGoal : topics::kCommand,
                static_cast<unsigned>(std::atoi(argv[5])));
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
