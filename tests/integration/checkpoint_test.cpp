/// Checkpoints survive a kill at any moment, and refuse what is not theirs.

#include "common/runtime/checkpoint.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/support/folder.h"
#include "tests/support/said.h"

using hamel::runtime::BootId;
using hamel::runtime::Checkpoint;

namespace {

constexpr std::uint32_t kKind = 7;
constexpr std::size_t kCapacity = 1000;

std::vector<std::byte> payload(unsigned char fill, std::size_t size) {
  return std::vector<std::byte>(size, std::byte{fill});
}

/// Two starts of a machine.
constexpr BootId kBoot{'o', 'n', 'e'}, kNextBoot{'t', 'w', 'o'};

class CheckpointTest : public testing::Test {
 protected:
  std::unique_ptr<Checkpoint> open(const BootId& boot = kBoot, std::uint32_t kind = kKind,
                                   std::size_t capacity = kCapacity) {
    auto c = Checkpoint::open(path, kind, capacity, boot);
    EXPECT_TRUE(c) << (c ? "" : to_string(c.error()));
    return c ? std::move(c).value() : nullptr;
  }
  /// What a restart resumes from; empty: nothing.
  std::vector<std::byte> newest(Checkpoint& c) {
    std::vector<std::byte> got;
    c.load([&](std::span<const std::byte> p, bool other_boot) {
      got.assign(p.begin(), p.end());
      rebooted = other_boot;
      return std::string();
    });
    return got;
  }
  std::vector<std::byte> newest(std::unique_ptr<Checkpoint> c) { return newest(*c); }
  void flip(const std::string& file, std::streamoff at) {
    std::fstream f(file, std::ios::in | std::ios::out | std::ios::binary);
    f.seekg(at);
    const char old = static_cast<char>(f.get());
    f.seekp(at);
    f.put(static_cast<char>(old ^ 0x40));
  }
  /// Saves 1, has it copied, saves 2 and 3: gone in a power cut.
  void save_three() {
    const auto c = open();
    c->save(payload(1, 20));
    c->sync(std::chrono::steady_clock::now());
    for (unsigned char i = 2; i <= 3; ++i) c->save(payload(i, 20));
  }

  const hamel::test::Folder folder;
  const std::string path = folder.path() + "/slot", aside = path + ".refused-1";
  hamel::test::Said said;
  bool rebooted = false;
};

TEST_F(CheckpointTest, IsEmptyAtFirst) {
  EXPECT_TRUE(newest(open()).empty());
  EXPECT_EQ(said.all(), "");
}

TEST_F(CheckpointTest, GivesBackTheLastSavedAfterReopening) {
  {
    const auto c = open();
    for (unsigned char i = 1; i <= 9; ++i) EXPECT_TRUE(c->save(payload(i, 10u + i)));
  }
  const auto c = open();
  EXPECT_EQ(newest(*c), payload(9, 19));
  EXPECT_FALSE(rebooted);
  EXPECT_TRUE(c->save(payload(10, 5)));  // and goes on from there
  EXPECT_EQ(newest(*c), payload(10, 5));
}

TEST_F(CheckpointTest, RefusesWhatDoesNotFit) {
  const auto c = open();
  EXPECT_TRUE(c->save(payload(1, kCapacity)));
  EXPECT_FALSE(c->save(payload(2, kCapacity + 1)));
  EXPECT_EQ(newest(*c), payload(1, kCapacity));
}

TEST_F(CheckpointTest, FallsBackToThePreviousWholeSlotWhereverTheLastIsDamaged) {
  for (std::streamoff at = 0; at < 100; ++at) {
    std::filesystem::remove(path);
    said.forget();
    {
      const auto c = open();
      c->save(payload(1, 20));  // sequence 1: second half of the file
      c->save(payload(2, 20));  // sequence 2: first half
    }
    flip(path, at);
    const auto got = newest(open());
    const bool padding = got == payload(2, 20);  // a byte of no meaning was flipped
    if (!padding) {
      EXPECT_EQ(got, payload(1, 20)) << "byte " << at;
      EXPECT_NE(said.all(), "") << "byte " << at;
    } else {
      EXPECT_GE(at, 92) << "damage at byte " << at << " went unseen";  // behind the payload
    }
  }
}

TEST_F(CheckpointTest, AnotherBootIsToldApart) {
  open()->save(payload(1, 8));
  EXPECT_EQ(newest(open(kNextBoot)), payload(1, 8));
  EXPECT_TRUE(rebooted);
  const auto c = open(kNextBoot);
  newest(*c);
  c->save(payload(2, 8));
  newest(*c);
  EXPECT_FALSE(rebooted) << "its own by now";
}

TEST_F(CheckpointTest, APowerCutLeavesTheCopyOnTheDisk) {
  save_three();
  std::filesystem::remove(path);  // no page of the map was written back
  EXPECT_EQ(newest(open(kNextBoot)), payload(1, 20));
  EXPECT_TRUE(rebooted);
}

TEST_F(CheckpointTest, TheCopyStandsInForTwoTornSlots) {
  save_three();
  for (std::streamoff at : {80, 4096 + 80}) flip(path, at);
  EXPECT_EQ(newest(open()), payload(1, 20));
  EXPECT_TRUE(said.has("a slot is damaged")) << said.all();
}

TEST_F(CheckpointTest, WhatReachedTheDiskLaterThanTheCopyIsNewer) {
  save_three();
  EXPECT_EQ(newest(open(kNextBoot)), payload(3, 20));
}

TEST_F(CheckpointTest, IsCopiedTwiceASecondAtMost) {
  const auto now = std::chrono::steady_clock::now();
  {
    const auto c = open();
    c->save(payload(1, 8));
    c->sync(now);
    c->save(payload(2, 8));
    c->sync(now + std::chrono::milliseconds(499));
  }
  std::filesystem::remove(path);
  EXPECT_EQ(newest(open()), payload(1, 8));
}

TEST_F(CheckpointTest, ADiskThatRefusesTheCopyIsNamedAndHoldsNobodyUp) {
  std::filesystem::create_directory(path + ".durable");  // nothing can be renamed to it
  {
    const auto c = open();
    c->save(payload(1, 8));
    c->sync(std::chrono::steady_clock::now());
    EXPECT_TRUE(c->save(payload(2, 8)));
  }
  EXPECT_TRUE(said.has("survives a power cut")) << said.all();
}

TEST_F(CheckpointTest, OfAnotherVersionIsRefusedAndKept) {
  open()->save(payload(1, 8));
  EXPECT_TRUE(newest(open(kBoot, kKind + 1)).empty());
  EXPECT_TRUE(said.has("version (0x7, here 0x8)")) << said.all();
  std::filesystem::rename(aside, path);
  EXPECT_EQ(newest(open()), payload(1, 8)) << "whole, where it was kept";
}

TEST_F(CheckpointTest, OfAnotherSizeIsRefusedAndKept) {
  open()->save(payload(1, 8));
  EXPECT_TRUE(newest(open(kBoot, kKind, 8 * kCapacity)).empty());
  EXPECT_TRUE(said.has("of another size")) << said.all();
  std::filesystem::rename(aside, path);
  EXPECT_EQ(newest(open()), payload(1, 8));
}

TEST_F(CheckpointTest, WhereTheNewestIsRefusedTheOneBeforeIsTriedAndTheFileKept) {
  {
    const auto c = open();
    c->save(payload(1, 8));
    c->save(payload(2, 8));
  }
  {
    const auto c = open();
    EXPECT_TRUE(c->load([](std::span<const std::byte> p, bool) {
      return std::string(p[0] == std::byte{2} ? "of another scene" : "");
    }));
    EXPECT_TRUE(said.has("of another scene: refused")) << said.all();
    c->save(payload(3, 8));
    EXPECT_EQ(newest(*c), payload(3, 8));
  }
  std::filesystem::rename(aside, path);
  EXPECT_EQ(newest(open()), payload(2, 8)) << "whole, where it was kept";
}

TEST_F(CheckpointTest, WhereAllIsRefusedOneStartsAfreshAndAllIsKept) {
  save_three();
  const auto refuse = [](std::span<const std::byte>, bool) { return std::string("of another scene"); };
  EXPECT_FALSE(open()->load(refuse));
  EXPECT_TRUE(newest(open()).empty());
  EXPECT_FALSE(open()->load(refuse)) << "nothing is there any more";
  EXPECT_FALSE(std::filesystem::exists(path + ".refused-2"));
  std::filesystem::rename(aside + ".durable", path + ".durable");
  EXPECT_EQ(newest(open()), payload(1, 20));
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
