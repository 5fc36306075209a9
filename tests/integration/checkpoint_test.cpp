/// Checkpoints survive a kill at any moment, and refuse what is not theirs.

#include "common/runtime/checkpoint.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include "tests/support/folder.h"

using hamel::runtime::Checkpoint;

namespace {

constexpr std::uint32_t kKind = 7;
constexpr std::size_t kCapacity = 1000;

std::vector<std::byte> payload(unsigned char fill, std::size_t size) {
  return std::vector<std::byte>(size, std::byte{fill});
}

class CheckpointTest : public testing::Test {
 protected:
  std::unique_ptr<Checkpoint> open(std::uint32_t kind = kKind) {
    auto c = Checkpoint::open(path, kind, kCapacity);
    EXPECT_TRUE(c) << (c ? "" : to_string(c.error()));
    return c ? std::move(c).value() : nullptr;
  }
  const hamel::test::Folder folder;
  const std::string path = folder.path() + "/slot";
  std::string note;
};

TEST_F(CheckpointTest, IsEmptyAtFirst) {
  EXPECT_TRUE(open()->load(note).empty());
  EXPECT_EQ(note, "");
}

TEST_F(CheckpointTest, GivesBackTheLastSavedAfterReopening) {
  {
    const auto c = open();
    for (unsigned char i = 1; i <= 9; ++i) EXPECT_TRUE(c->save(payload(i, 10u + i)));
  }
  const auto c = open();
  EXPECT_EQ(c->load(note), payload(9, 19));
  EXPECT_TRUE(c->save(payload(10, 5)));  // and goes on from there
  EXPECT_EQ(c->load(note), payload(10, 5));
}

TEST_F(CheckpointTest, RefusesWhatDoesNotFit) {
  const auto c = open();
  EXPECT_TRUE(c->save(payload(1, kCapacity)));
  EXPECT_FALSE(c->save(payload(2, kCapacity + 1)));
  EXPECT_EQ(c->load(note), payload(1, kCapacity));
}

TEST_F(CheckpointTest, FallsBackToThePreviousWholeSlotWhereverTheLastIsDamaged) {
  for (std::streamoff at = 0; at < 60; ++at) {
    std::filesystem::remove(path);
    {
      const auto c = open();
      c->save(payload(1, 20));  // sequence 1: second half of the file
      c->save(payload(2, 20));  // sequence 2: first half
    }
    {
      std::fstream f(path, std::ios::in | std::ios::out | std::ios::binary);
      f.seekg(at);
      const char old = static_cast<char>(f.get());
      f.seekp(at);
      f.put(static_cast<char>(old ^ 0x40));
    }
    const auto got = open()->load(note);
    const bool padding = got == payload(2, 20);  // a byte of no meaning was flipped
    if (!padding) {
      EXPECT_EQ(got, payload(1, 20)) << "byte " << at;
      EXPECT_NE(note, "") << "byte " << at;
    } else {
      EXPECT_GE(at, 52) << "damage at byte " << at << " went unseen";  // behind the payload
    }
  }
}

TEST_F(CheckpointTest, RefusesAForeignKind) {
  open()->save(payload(1, 8));
  EXPECT_TRUE(open(kKind + 1)->load(note).empty());
  EXPECT_NE(note.find("foreign"), std::string::npos);
}

TEST_F(CheckpointTest, HasOneWriter) {
  const auto first = open();
  const auto second = Checkpoint::open(path, kKind, kCapacity);
  ASSERT_FALSE(second);
  EXPECT_NE(second.error().what.find("in use"), std::string::npos);
}

TEST_F(CheckpointTest, NamesAFolderThatIsNotThere) {
  const auto c = Checkpoint::open(folder.path() + "/none/slot", kKind, kCapacity);
  ASSERT_FALSE(c);
  EXPECT_NE(c.error().where.find("none"), std::string::npos);
}

}  // namespace
