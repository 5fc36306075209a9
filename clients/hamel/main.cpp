/// hamel: the command line.

#include "clients/hamel/commands.h"
#include "clients/hamel/figures.h"
#include "clients/hamel/plot.h"
#include "clients/hamel/trade.h"
#include "common/runtime/signals.h"

using namespace hamel;

namespace {

void add_run_like(CLI::App& app, client::RunArgs& a) {
  runtime::add_run_options(app, a.run);
  app.add_flag("--json", a.json, "one JSON object on stdout instead of the table");
  app.add_option("--csv", a.csv_path,
                 "write every step: t_s, q, qd, tau, end effector, clearance, energy, iterations")
      ->type_name("FILE");
}

CLI::App* add_trade(CLI::App& app, client::TradeArgs& a) {
  auto* trade =
      app.add_subcommand("trade", "measure accuracy against cost of every tier on a scene's free motion");
  trade->add_option("scene", a.scene_path, "scene file (.textproto)")->required()->type_name("SCENE");
  trade->add_option("--set", a.overrides, "override a field of the scene; repeat")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  trade->add_option("--horizon", a.horizon_s, "seconds of motion instead of the scene's")
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS");
  trade->add_option("--tick", a.tick_s, "try no step longer than this control tick")
      ->check(CLI::PositiveNumber)
      ->type_name("SECONDS");
  trade
      ->add_option("--accuracy", a.accuracy,
                   "recommend tier and dt that keep every joint within this [rad or m]")
      ->check(CLI::PositiveNumber);
  trade->add_option("--by", a.by, "what counts as cost: time or evaluations")
      ->check(CLI::IsMember({"time", "evaluations"}))
      ->capture_default_str();
  trade->add_flag("--quick", a.quick, "fewer steps and tolerances");
  trade->add_option("--csv", a.csv_path, "write every measurement")->type_name("FILE");
  trade->add_option("--plot", a.plot_path, "draw cost against error, .svg or .png (needs gnuplot)")
      ->type_name("FILE");
  return trade;
}

CLI::App* add_figures(CLI::App& app, client::FiguresArgs& a) {
  auto* figures = app.add_subcommand(
      "figures", "draw figures 3, 4 and 5 of the paper from a free motion (needs gnuplot)");
  figures->add_option("scene", a.scene_path, "scene file; the paper's is three_link_swing.textproto")
      ->required()
      ->type_name("SCENE");
  figures->add_option("--set", a.overrides, "override a field of the scene; repeat")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  figures->add_option("-o,--output", a.folder, "folder for csv, svg and png")->required()->type_name("DIR");
  return figures;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"hamel: robot-arm dynamics and reactive planning as services on a DDS network"};
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "help of every verb");

  client::RunArgs run_args, up_args;
  auto* run =
      app.add_subcommand("run", "run a scene in this process (lockstep, inproc unless asked otherwise)");
  add_run_like(*run, run_args);
  auto* up = app.add_subcommand("up", "run a scene as one supervised process a service (realtime over DDS)");
  add_run_like(*up, up_args);

  client::GoalArgs goal_args;
  auto* goal = app.add_subcommand("goal", "send an arm somewhere else");
  goal->add_option("--arm", goal_args.arm, "arm")->capture_default_str();
  auto* kind = goal->add_option_group("target", "exactly one");
  kind->add_option("--position", goal_args.position_m, "end effector, x y z in m, world")->expected(3);
  kind->add_option("--pose", goal_args.pose, "end effector, x y z in m and quaternion x y z w, world")
      ->expected(7);
  kind->add_option("--joints", goal_args.joints, "every joint, rad or m");
  kind->require_option(1);
  runtime::add_bus_options(*goal, goal_args.bus);

  client::ModeArgs mode_args;
  std::vector<CLI::App*> modes;
  for (const auto& [name, help] :
       {std::pair{"stop", "brake to rest and stay, until resume"},
        std::pair{"hold", "keep this place, until resume"}, std::pair{"resume", "go on to the goal"},
        std::pair{"clear-fault", "leave FAULT and go on"}}) {
    auto* m = app.add_subcommand(name, help);
    m->add_option("--arm", mode_args.arm, "arm")->capture_default_str();
    runtime::add_bus_options(*m, mode_args.bus);
    modes.push_back(m);
  }

  client::StatusArgs status_args;
  auto* status = app.add_subcommand("status", "who runs, which version, how it fares");
  status->add_option("--seconds", status_args.seconds, "how long to listen")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  status->add_flag("--json", status_args.json, "one JSON object on stdout");
  runtime::add_bus_options(*status, status_args.bus);

  client::PlotArgs plot_args;
  auto* plot = app.add_subcommand("plot", "draw a run from the file that --csv wrote (needs gnuplot)");
  plot->add_option("scene", plot_args.scene_path, "scene file (.textproto)")->required()->type_name("SCENE");
  plot->add_option("csv", plot_args.csv_path, "written by --csv of that scene")->required()->type_name("CSV");
  plot->add_option("-o,--output", plot_args.out_path, "picture, .svg or .png")->required()->type_name("FILE");
  plot->add_option("--set", plot_args.overrides, "overrides the run was made with")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);

  client::TradeArgs trade_args;
  const auto* trade = add_trade(app, trade_args);
  client::FiguresArgs figures_args;
  const auto* figures = add_figures(app, figures_args);

  if (const auto code = runtime::parse(app, argc, argv)) return *code;
  if (plot->parsed()) return client::plot(plot_args);
  if (figures->parsed()) return client::figures(figures_args);
  if (trade->parsed()) return client::trade(trade_args);
  if (run->parsed()) return client::run(run_args);
  if (up->parsed()) return client::up(up_args);
  if (goal->parsed()) return client::goal(goal_args);
  if (status->parsed()) return client::status(status_args);
  for (const auto* m : modes) {
    if (!m->parsed()) continue;
    mode_args.mode = m->get_name();
    return client::mode(mode_args);
  }
  return runtime::kBadInput;
}
