// The operations of a midpoint step, of its exact Jacobian and of forward dynamics are exactly linear in the
// number of joints.  The sources are compiled a second time, and this file with them, so that every block of
// code says when it runs: a block is a fixed run of operations, and each must run a + b n times, to the unit.
#include <gtest/gtest.h>

#include <functional>
#include <unordered_map>

#include "common/rbd/rbd.h"
#include "services/dynamics/core/marcher.h"
#include "services/dynamics/core/midpoint.h"
#include "tests/support/chains.h"

namespace {

using Runs = std::unordered_map<const void*, long>;
Runs* runs = nullptr;  // of each block, by its address; null: not counted

}  // namespace

// NOLINTNEXTLINE: the compiler's name for it
extern "C" [[gnu::no_sanitize_coverage]] void __sanitizer_cov_trace_pc() {
  Runs* const mine = runs;
  if (mine == nullptr) return;
  runs = nullptr;  // the table is counted neither
  ++(*mine)[__builtin_return_address(0)];
  runs = mine;
}

namespace hamel::dynamics {
namespace {

Runs counted(const std::function<void()>& work) {
  Runs out;
  runs = &out;
  work();
  runs = nullptr;
  return out;
}

/// Two lengths tell what a joint adds to each block, every other length must agree.  Even ones: joints are
/// stored two by two.
void expect_linear(const std::function<Runs(int n)>& runs_of) {
  const Runs few = runs_of(10), more = runs_of(20);
  long each = 0;
  for (const auto& [block, count] : more) each += count;
  for (const auto& [block, count] : few) each -= count;
  EXPECT_GE(each, 10) << "nothing was counted";
  for (const int n : {4, 6, 40, 80, 300}) {
    Runs left = runs_of(n);
    for (const Runs* known : {&few, &more})
      for (const auto& [block, count] : *known) left.try_emplace(block, 0);
    int wrong = 0;
    for (const auto& [block, count] : left) {
      const auto at_10 = few.find(block), at_20 = more.find(block);
      const long a = at_10 == few.end() ? 0 : at_10->second, b = at_20 == more.end() ? 0 : at_20->second;
      wrong += 10 * (count - a) != (n - 10) * (b - a);
    }
    EXPECT_EQ(wrong, 0) << "of " << left.size() << " blocks at " << n << " joints";
  }
}

/// Arms of joints of one kind, or of two in turn.
enum class Kind { turns, slides, both };
const char* name(Kind kind) {
  return kind == Kind::turns ? "turns" : kind == Kind::slides ? "slides" : "both";
}
model::Chain arm(int n, Kind kind) {
  model::ChainSpec spec = test::planar(n, 1, 0.1, 0.01);
  for (int i = 0; i < n; ++i) {
    model::Joint& joint = spec.joints[static_cast<std::size_t>(i)];
    joint.damping = 0.1, joint.armature = 0.01;
    if (kind == Kind::turns || (kind == Kind::both && i % 2 == 0)) continue;
    joint.kind = model::JointKind::prismatic;
    joint.axis = Eigen::Vector3d::UnitX();
  }
  return test::checked(spec);
}

/// A moving arm, pushed at its joints and links, and the midpoint tier about to take a step.
template <class G>
struct Scene {
  Scene(int n, Kind kind, Options o)
      : chain(arm(n, kind)), options(o), load(n), from(chain), to(chain), d(VectorXd::Constant(n, 1e-4)) {
    load.tau.setConstant(0.1);
    load.pushed = true;
    from.place(chain, VectorXd::Constant(n, 0.1));
    from.move_with_velocity(chain, VectorXd::Constant(n, 0.1));
    from.move_with_momentum(chain);
  }
  typename G::Chain chain;
  Options options;
  Load<G> load;
  Node<G> from, to;
  VectorXd d;
};

template <class G>
class Blocks : public testing::Test {
 protected:
  /// `work` on a midpoint tier whose residual is known, at the beginning of a step.
  void expect_linear_tier(const Options& options,
                          const std::function<void(MidpointStep<G>&, VectorXd& d)>& work) {
    for (const Kind kind : {Kind::turns, Kind::slides, Kind::both}) {
      SCOPED_TRACE(name(kind));
      expect_linear([&](int n) {
        Scene<G> scene(n, kind, options);
        MidpointStep<G> tier(scene.chain, scene.options);
        tier.begin(scene.from, scene.load, options.dt_s);
        static_cast<void>(tier.evaluate(scene.d));
        tier.begin(scene.from, scene.load, options.dt_s);
        return counted([&] { work(tier, scene.d); });
      });
    }
  }
};
using Groups = testing::Types<SE3, SE2>;
TYPED_TEST_SUITE(Blocks, Groups);

TYPED_TEST(Blocks, OfAResidualAreLinear) {
  this->expect_linear_tier({}, [](auto& tier, VectorXd& d) { static_cast<void>(tier.evaluate(d)); });
}

TYPED_TEST(Blocks, OfTheExactJacobianAndItsSolutionAreLinear) {
  this->expect_linear_tier({.root = Root::newton}, [](auto& tier, VectorXd&) { tier.linearise_and_solve(); });
}

TYPED_TEST(Blocks, OfAnUpdateByNewtonAreLinear) {
  this->expect_linear_tier({.root = Root::newton}, [](auto& tier, VectorXd& d) {
    tier.correct(d);  // with a new Jacobian
    tier.correct(d);  // with the same
  });
}

/// All of a step but the residuals and updates beyond its first: guess, guards, history, M at the new node.
TYPED_TEST(Blocks, OfAStepOfOneEvaluationAreLinear) {
  using G = TypeParam;
  for (const Kind kind : {Kind::turns, Kind::slides, Kind::both}) {
    SCOPED_TRACE(name(kind));
    expect_linear([&](int n) {
      Scene<G> scene(n, kind, {.tolerance_Nm = 1e6});
      const Options& options = scene.options;
      Marcher<G> marcher(scene.chain, options, std::make_unique<MidpointStep<G>>(scene.chain, options));
      State s = marcher.start(scene.from.q, scene.from.qd);
      for (int k = 0; k < 3; ++k) EXPECT_TRUE(marcher.step(s, scene.load).usable());
      return counted([&] {
        const StepReport report = marcher.step(s, scene.load);
        if (report.evaluations != 1 || !report.usable()) runs->clear();  // fails
      });
    });
  }
}

TYPED_TEST(Blocks, OfForwardDynamicsAreLinear) {
  using G = TypeParam;
  for (const Kind kind : {Kind::turns, Kind::slides, Kind::both}) {
    SCOPED_TRACE(name(kind));
    expect_linear([&](int n) {
      const typename G::Chain chain(arm(n, kind));
      rbd::Sweep<G> sweep(n);
      const VectorXd q = VectorXd::Constant(n, 0.1), tau = VectorXd::Constant(n, 0.2);
      VectorXd qdd(n);
      return counted(
          [&] { rbd::forward_dynamics(chain, q.data(), q.data(), tau.data(), sweep, qdd.data()); });
    });
  }
}

}  // namespace
}  // namespace hamel::dynamics
