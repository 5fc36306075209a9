/// What every vendor's bus must tell alike of its peers: who wrote, who takes back, who lives, who is there,
/// and who cannot agree with us.

#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <map>
#include <mutex>
#include <vector>

#include "tests/integration/bus_pairs.h"

namespace hamel::test {
namespace {

TEST_P(Bus, TellsWhoWrote) {
  const auto a = from(13), b = to(13);
  const auto first = a->writer(topics::kGoal), second = a->writer(topics::kGoal);
  const auto reader = b->reader(topics::kGoal);
  EXPECT_NE(first->id(), second->id());
  ASSERT_TRUE(first->write(sample(1, 1)));
  ASSERT_TRUE(second->write(sample(2, 2)));
  std::map<std::uint32_t, bus::WriterId> by;
  Payload p;
  ASSERT_TRUE(wait_for(*b, [&] {
    while (reader->take(p)) by[key_in(p)] = reader->from();
    return by.size() == 2;
  }));
  EXPECT_EQ(by[1], first->id());
  EXPECT_EQ(by[2], second->id());
}

TEST_P(Bus, AKeyThatIsDisposedIsGoneForLateReaders) {
  const auto a = from(14), b = to(14);
  const auto writer = a->writer(topics::kGoal);
  const auto early = b->reader(topics::kGoal);
  for (const std::uint32_t key : {1U, 0x12345678U}) ASSERT_TRUE(writer->write(sample(key, key)));
  Payload p;
  int taken = 0;
  ASSERT_TRUE(wait_for(*b, [&] {
    while (early->take(p)) ++taken;
    return taken == 2;
  }));
  ASSERT_TRUE(writer->dispose(sample(0x12345678, 0)));
  ASSERT_TRUE(wait_for(*b, [&] { return !early->take(p) && early->counters().disposed == 1; }));
  const auto late = b->reader(topics::kGoal);
  ASSERT_TRUE(wait_for(*b, [&] { return late->take(p); }));
  EXPECT_EQ(key_in(p), 1U);
  // A word said after the dispose comes behind whatever the late reader was given of the past.
  ASSERT_TRUE(writer->write(sample(5, 5)));
  ASSERT_TRUE(wait_for(*b, [&] { return late->take(p); }));
  EXPECT_EQ(key_in(p), 5U);
}

TEST_P(Bus, BrokenPromisesAreCounted) {
  if (GetParam().from == Vendor::inproc) return;  // a writer within the process needs no watching
  const auto a = from(15), b = to(15);
  const auto reader = b->reader(topics::kCommand, 0, bus::Ask::promises),
             lenient = b->reader(topics::kCommand);
  auto node = open(GetParam().from, GetParam().domain + 15);
  const auto writer = node->writer(topics::kCommand);
  Payload p;
  ASSERT_TRUE(wait_for(*b, [&] {
    writer->write(sample(1, 1));
    return reader->take(p) && lenient->take(p);
  }));
  EXPECT_TRUE(wait_for(*b, [&] { return reader->counters().late > 0; })) << "deadline: nothing for 50 ms";
  EXPECT_EQ(lenient->counters().late, 0U) << "did not ask";
}

/// From the first listing on, no end stands there without its participant.
TEST_P(Bus, ListsTheEndsOfOthers) {
  const auto a = from(16), b = to(16);
  const auto writer = a->writer(topics::kGoal);
  const auto reader = a->reader(topics::kState);
  std::vector<bus::Endpoint> ends;
  ASSERT_TRUE(wait_for(*b, [&] {
    ends = b->endpoints();
    for (const bus::Endpoint& e : ends) EXPECT_TRUE(!e.writes || e.participant == "hamel") << e.topic;
    return ends.size() >= 2;
  }));
  ASSERT_EQ(ends.size(), 2U);
  for (const bus::Endpoint& e : ends) {
    EXPECT_EQ(e.topic, e.writes ? "hamel/v1/goal" : "hamel/v1/state");
    EXPECT_EQ(e.type, e.writes ? "hamel::v1::Goal" : "hamel::v1::ArmState");
    EXPECT_TRUE(e.reliable);
    EXPECT_EQ(e.latched, e.writes);
    EXPECT_TRUE(!e.writes || e.id == writer->id());
  }
}

/// A reader that asks for what its writer does not offer: counted on both sides and said once.
TEST_P(Bus, DisagreementAboutQosIsCountedAndSaidOnce) {
  if (GetParam().from == Vendor::inproc) return;  // one process cannot disagree with itself
  Topic stream = topics::kGoal;
  stream.delivery = Delivery::stream;
  std::mutex mutex;
  std::vector<std::string> said;
  const auto log = [&](const std::string& line) {
    std::lock_guard lock(mutex);
    said.push_back(line);
  };
  const auto a = from(12, log), b = to(12, log);
  const auto writer = a->writer(stream);
  const auto reader = b->reader(topics::kGoal);
  ASSERT_TRUE(wait_for(*b, [&] {
    a->wait(std::chrono::steady_clock::now());
    std::lock_guard lock(mutex);
    return writer->counters().incompatible > 0 && reader->counters().incompatible > 0 && said.size() == 2;
  }));
  EXPECT_EQ(writer->matched(), 0);
  std::lock_guard lock(mutex);
  ASSERT_EQ(said.size(), 2U);
  for (const std::string& line : said) {
    EXPECT_NE(line.find("hamel/v1/goal"), std::string::npos) << line;
    EXPECT_NE(line.find("durability"), std::string::npos) << line;
    EXPECT_NE(line.find("volatile"), std::string::npos) << line;
    EXPECT_NE(line.find("transient-local"), std::string::npos) << "both sides: " << line;
    EXPECT_NE(line.find("of hamel"), std::string::npos) << "whose: " << line;
  }
}

/// Each peer is named, with what the policy in question is on both sides.
TEST_P(Bus, EveryPeerThatBreaksAPolicyIsNamedWithItsValues) {
  if (GetParam().from == Vendor::inproc) return;
  Topic slow = topics::kState;
  slow.stale = 80ms;
  std::string said;
  int lines = 0;
  const auto b = to(19, [&](const std::string& line) {
    said = line;
    ++lines;
  });
  const auto reader = b->reader(topics::kState, 0, bus::Ask::promises);
  std::vector<std::unique_ptr<bus::Node>> nodes;
  std::vector<std::unique_ptr<bus::Writer>> writers;
  for (const std::string name : {"one", "two"}) {
    nodes.push_back(open(GetParam().from, GetParam().domain + 19, {}, name));
    writers.push_back(nodes.back()->writer(slow));
    ASSERT_TRUE(wait_for(*b, [&] { return said.find("of " + name + " offers") != std::string::npos; }))
        << said;
    for (const char* part : {"hamel/v1/state", "deadline", "51 ms", "80 ms"})
      EXPECT_NE(said.find(part), std::string::npos) << said;
    EXPECT_EQ(b->complaint(), said);
  }
  EXPECT_EQ(lines, 2);
  while (!writers.empty()) writers.pop_back();
}

/// A topic of ours with another type on it: no vendor says so, and no data flows.
TEST_P(Bus, EveryPeerOfAnotherTypeIsNamedOnce) {
  if (GetParam().from == Vendor::inproc) return;
  Topic other = topics::kGoal;
  other.type = "elsewhere::Goal";
  std::vector<std::string> said;
  const auto a = from(13);
  const auto b = to(13, [&](const std::string& line) { said.push_back(line); });
  const auto writer = a->writer(other);
  const auto reader = b->reader(topics::kGoal);
  ASSERT_TRUE(wait_for(*b, [&] { return !said.empty(); })) << "there before us, or after";
  const auto asks = a->reader(other);
  ASSERT_TRUE(wait_for(*b, [&] { return said.size() >= 2; }));
  EXPECT_FALSE(wait_for(
      *b, [&] { return said.size() > 2; }, 700ms))
      << said.back();
  EXPECT_NE(said[0].find("the writer of hamel"), std::string::npos) << said[0];
  EXPECT_NE(said[1].find("the reader of hamel"), std::string::npos) << said[1];
  for (const std::string& line : said)
    for (const char* part : {"hamel/v1/goal", "elsewhere::Goal", "hamel::v1::Goal"})
      EXPECT_NE(line.find(part), std::string::npos) << line;
  EXPECT_EQ(b->complaint(), said.back());
  EXPECT_EQ(reader->matched(), 0);
}

/// A writer that leaves without a word: those that asked for it hear that it is silent.
TEST_P(Bus, AWriterThatNoLongerSaysThatItLivesIsSilent) {
  if (GetParam().from == Vendor::inproc) return;  // a writer within the process needs no watching
  const auto b = to(15);
  const auto reader = b->reader(topics::kGoal, 0, bus::Ask::promises), lenient = b->reader(topics::kGoal);
  int status = 0;
  const pid_t mute = fork();
  if (mute == 0) {
    execl("/proc/self/exe", "mute", to_string(GetParam().from),
          std::to_string(GetParam().domain + 15).c_str(), nullptr);
    _exit(1);
  }
  Payload p;
  EXPECT_TRUE(wait_for(*b, [&] { return reader->take(p); }));
  EXPECT_EQ(reader->counters().silent, 0U) << "it lives";
  kill(mute, SIGSTOP);
  EXPECT_TRUE(wait_for(*b, [&] { return reader->counters().silent > 0; })) << "nothing for a second";
  kill(mute, SIGKILL);
  waitpid(mute, &status, 0);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Bus, kPairs, name_of);

/// A writer of a process of its own, which says something once and then only that it lives.
[[noreturn]] void stay(Vendor vendor, std::uint32_t domain) {
  const auto node = open(vendor, domain);
  const auto writer = node->writer(topics::kGoal);
  writer->write(sample(1, 1));
  while (true) node->wait(std::chrono::steady_clock::now() + kDeadline);
}

}  // namespace
}  // namespace hamel::test

int main(int argc, char** argv) {
  if (argc == 3 && std::string_view(argv[0]) == "mute") {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    hamel::test::stay(hamel::bus::vendor_from(argv[1]).value(),
                      static_cast<std::uint32_t>(std::atoi(argv[2])));
  }
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
