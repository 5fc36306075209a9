/// hamel: the command line.

#include <cerrno>
#include <system_error>

#include "clients/hamel/batch_verb.h"
#include "clients/hamel/bench.h"
#include "clients/hamel/commands.h"
#include "clients/hamel/explain.h"
#include "clients/hamel/figures.h"
#include "clients/hamel/network_verbs.h"
#include "clients/hamel/plot.h"
#include "clients/hamel/record.h"
#include "clients/hamel/replay.h"
#include "clients/hamel/trade.h"
#include "common/runtime/signals.h"

using namespace hamel;

namespace {

void add_overrides(CLI::App& app, std::vector<std::string>& overrides, const char* help) {
  app.add_option("--set", overrides, help)->type_name("PATH=VALUE")->allow_extra_args(false);
}

void add_run_like(CLI::App& app, client::RunArgs& a) {
  runtime::add_run_options(app, a.run);
  app.add_flag("--json", a.json, "one JSON object on stdout instead of the table");
  app.add_option(
         "--csv", a.csv_path,
         "write every step: t_s, q, qd, tau, end effector, clearance, energy, iterations; of a steered arm "
         "also "
         "the planner's state, energies, powers and cycle time, and of each link the nearest obstacle, its "
         "distance, gate, forces and barrier multiplier")
      ->type_name("FILE");
  app.add_option("--record", a.record_path, "keep every message of the run in this file (MCAP)")
      ->type_name("FILE");
  app.add_option("--compression", a.compression, "of the recording: none, lz4 or zstd")
      ->capture_default_str();
}

/// record and log: their options, and what to do when they were asked for.
class RecordVerbs {
 public:
  explicit RecordVerbs(CLI::App& app) {
    record_ = app.add_subcommand("record", "keep every message of the bus in a file (MCAP) until Ctrl-C");
    record_->add_option("-o,--output", record_args_.path, "recording")->required()->type_name("FILE");
    record_->add_option("--compression", record_args_.compression, "none, lz4 or zstd")
        ->capture_default_str();
    record_->add_option("--duration", record_args_.duration_s, "end after so many seconds")
        ->check(runtime::positive());
    record_->add_option("--scene", record_args_.scene_path,
                        "scene of the run, kept in the recording for replays");
    add_overrides(*record_, record_args_.overrides, "overrides of the run");
    runtime::add_bus_options(*record_, record_args_.bus);

    log_ = app.add_subcommand("log", "look into a recording");
    log_->require_subcommand(1);
    info_ = add_log("info", "what it holds, and whether it is whole");
    info_->add_flag("--json", log_args_.json, "one JSON object");
    cat_ = add_log("cat", "every message, a line each");
    cat_->add_flag("--json", log_args_.json, "one JSON object a line");
    add_part(*cat_);
    csv_ = add_log("csv", "the messages of one topic as a table");
    add_part(*csv_);
    csv_->get_option("--topic")->required();
    csv_->add_option("-o,--output", log_args_.out_path, "file instead of stdout");
    recover_ = add_log("recover", "copy what is whole of a cut or damaged recording, with a new index");
    recover_->add_option("-o,--output", log_args_.out_path, "new file")->required();
    recover_->add_option("--compression", log_args_.compression, "none, lz4 or zstd")->capture_default_str();
    add_replay(app);
    add_play(app);
  }

  std::optional<int> run() const {
    if (play_->parsed()) return client::play(play_args_);
    if (replay_->parsed()) return client::replay(replay_args_);
    if (record_->parsed()) return client::record(record_args_);
    if (info_->parsed()) return client::log_info(log_args_);
    if (cat_->parsed()) return client::log_cat(log_args_);
    if (csv_->parsed()) return client::log_csv(log_args_);
    if (recover_->parsed()) return client::log_recover(log_args_);
    return {};
  }

 private:
  CLI::App* add_log(const char* name, const char* help) {
    auto* verb = log_->add_subcommand(name, help);
    verb->add_option("file", log_args_.path, "recording")->required()->type_name("FILE");
    return verb;
  }
  void add_part(CLI::App& verb) {
    verb.add_option("--topic", log_args_.topic, "one topic: state, command, obstacles, report, ...");
    verb.add_option("--start", log_args_.begin_s, "from this time of the run on")
        ->type_name("SECONDS")
        ->check(runtime::finite());
    verb.add_option("--until", log_args_.end_s, "up to this time of the run")
        ->type_name("SECONDS")
        ->check(runtime::finite());
  }

  void add_replay(CLI::App& app) {
    replay_ = app.add_subcommand(
        "replay", "feed a recording to a service and compare what comes out with what was recorded");
    replay_->add_option("file", replay_args_.path, "recording")->required()->type_name("FILE");
    replay_->add_option("--into", replay_args_.into, "planner or dynamics")
        ->required()
        ->check(CLI::IsMember({"planner", "dynamics"}));
    replay_->add_flag("--check", replay_args_.check, "exit code 1 where anything differs");
    replay_
        ->add_option("--tolerance", replay_args_.tolerances,
                     "absolute, of one field (torque=1e-9) or of all (*=1e-12); repeat")
        ->type_name("FIELD=NUMBER")
        ->allow_extra_args(false);
    replay_->add_option("--scene", replay_args_.scene_path, "scene to use instead of the recorded one");
    add_overrides(*replay_, replay_args_.overrides, "override a field of the scene");
    replay_->add_flag("--json", replay_args_.json, "one JSON object");
  }

  void add_play(CLI::App& app) {
    play_ =
        app.add_subcommand("play", "put recorded messages on the bus again, byte for byte, at their times");
    play_->add_option("file", play_args_.path, "recording (.mcap), or obstacle stream (.csv)")
        ->required()
        ->type_name("FILE");
    play_->add_option("--topic", play_args_.topics, "obstacles, clock, ...; repeat")
        ->allow_extra_args(false)
        ->capture_default_str();
    play_->add_option("--rate", play_args_.rate, "recorded seconds a second")
        ->check(runtime::positive())
        ->capture_default_str();
    play_->add_option("--start", play_args_.begin_s, "from this time of the run on")
        ->type_name("SECONDS")
        ->check(runtime::finite());
    play_->add_option("--until", play_args_.end_s, "up to this time of the run")
        ->type_name("SECONDS")
        ->check(runtime::finite());
    play_->add_flag("--loop", play_args_.loop, "begin anew at the end, until Ctrl-C");
    play_->add_flag("--control", play_args_.control,
                    "obey standard input: pause, resume, step, quit, or the keys space . q");
    play_->add_flag("--paused", play_args_.paused, "with --control: begin paused");
    play_->add_option("--arm", play_args_.arm, "arm whose perception a CSV stands for")
        ->capture_default_str();
    runtime::add_bus_options(*play_, play_args_.bus);
  }

  client::RecordArgs record_args_;
  client::PlayArgs play_args_;
  client::ReplayArgs replay_args_;
  client::LogArgs log_args_;
  CLI::App *record_, *play_, *replay_, *log_, *info_, *cat_, *csv_, *recover_;
};

CLI::App* add_plot(CLI::App& app, client::PlotArgs& a) {
  auto* plot = app.add_subcommand("plot", "draw a run (needs gnuplot)");
  plot->add_option("file", a.path, "recording (.mcap), or what --csv wrote")->required()->type_name("FILE");
  plot->add_option("-o,--output", a.out_path, "picture, .svg or .png")->required()->type_name("FILE");
  plot->add_option("--kind", a.kinds, "path, clearance, energy, iterations, latencies or all; repeat")
      ->check(CLI::IsMember({"path", "clearance", "energy", "iterations", "latencies", "all"}))
      ->allow_extra_args(false);
  plot->add_option("--scene", a.scene_path,
                   "scene of a CSV: draws arm, obstacles and target too; of a recording: instead of its own")
      ->type_name("SCENE");
  add_overrides(*plot, a.overrides, "overrides the run was made with");
  return plot;
}

CLI::App* add_trade(CLI::App& app, client::TradeArgs& a) {
  auto* trade =
      app.add_subcommand("trade", "measure accuracy against cost of every tier on an arm's free motion");
  trade->add_option("model", a.scene_path, "scene (.textproto), or a robot (.urdf) that falls from rest")
      ->required()
      ->type_name("MODEL|SCENE");
  add_overrides(*trade, a.overrides, "override a field of the scene; repeat");
  trade->add_option("--horizon", a.horizon_s, "seconds of motion instead of the scene's")
      ->check(runtime::positive())
      ->type_name("SECONDS");
  trade->add_option("--tick", a.tick_s, "try no step longer than this control tick")
      ->check(runtime::positive())
      ->type_name("SECONDS");
  trade
      ->add_option(
          "--accuracy", a.accuracy,
          "recommend tier and dt that keep every joint within this [rad or m]: twice the error at 20 "
          "instants and the reference's own must be less")
      ->check(runtime::positive());
  trade->add_option("--by", a.by, "what counts as cost: time or evaluations")
      ->check(CLI::IsMember({"time", "evaluations"}))
      ->capture_default_str();
  trade->add_flag("--quick", a.quick, "fewer steps and tolerances");
  trade->add_option("--jobs", a.jobs, "threads; the times of several at once are worth less")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
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
  add_overrides(*figures, a.overrides, "override a field of the scene; repeat");
  figures->add_option("-o,--output", a.folder, "folder for csv, svg and png")->required()->type_name("DIR");
  return figures;
}

CLI::App* add_explain(CLI::App& app, client::ExplainArgs& a) {
  auto* explain =
      app.add_subcommand("explain", "what a scene requires, what was left out and why, and what that bought");
  explain->add_option("scene", a.scene_paths, "scene file (.textproto); several with --table")
      ->required()
      ->type_name("SCENE");
  explain->add_option("--set", a.overrides, "override a field of the scene; repeat")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  auto* json = explain->add_flag("--json", a.json, "one JSON object");
  explain
      ->add_flag("--table", a.table,
                 "speed against accuracy instead: full, exact and fastest fidelity of each scene, Markdown")
      ->excludes(json);
  explain->add_option("--seconds", a.seconds, "CPU time for each measurement of cost")
      ->check(runtime::positive())
      ->capture_default_str();
  return explain;
}

CLI::App* add_batch(CLI::App& app, client::BatchArgs& a) {
  auto* batch = app.add_subcommand("batch", "run many variations of a scene on all cores");
  batch->add_option("file", a.path, "what to vary: .textproto (deploy/README.md), or .csv beside --scene")
      ->required()
      ->type_name("FILE");
  batch->add_option("--scene", a.scene_path, "scene file, instead of the one that the file names")
      ->type_name("SCENE");
  batch->add_option("--set", a.overrides, "override a field of every variation; repeat")
      ->type_name("PATH=VALUE")
      ->allow_extra_args(false);
  batch->add_option("-o,--output", a.out_path, "CSV, a row a variation; a killed batch goes on from there")
      ->type_name("FILE");
  batch->add_option("-j,--workers", a.workers, "threads; 0: one a core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  return batch;
}

int verbs(int argc, char** argv) {
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
        std::pair{"clear-fault", "forget faults and clocks; a stop or hold stays"}}) {
    auto* m = app.add_subcommand(name, help);
    m->add_option("--arm", mode_args.arm, "arm")->capture_default_str();
    runtime::add_bus_options(*m, mode_args.bus);
    modes.push_back(m);
  }

  client::StatusArgs status_args;
  auto* status = app.add_subcommand("status", "who runs, which version, how it fares");
  status->add_option("--seconds", status_args.seconds, "how long to listen")
      ->capture_default_str()
      ->check(runtime::positive());
  status->add_flag("--json", status_args.json, "one JSON object on stdout");
  runtime::add_bus_options(*status, status_args.bus);

  client::PlotArgs plot_args;
  const auto* plot = add_plot(app, plot_args);

  client::TradeArgs trade_args;
  const auto* trade = add_trade(app, trade_args);
  client::FiguresArgs figures_args;
  const auto* figures = add_figures(app, figures_args);

  client::ExplainArgs explain_args;
  const auto* explain = add_explain(app, explain_args);
  client::BatchArgs batch_args;
  const auto* batch = add_batch(app, batch_args);

  RecordVerbs recordings(app);
  client::BenchVerb bench(app);
  const client::NetworkVerbs network(app);  // adds to bench

  if (const auto code = runtime::parse(app, argc, argv)) return *code;
  if (const auto code = recordings.run()) return *code;
  if (const auto code = bench.run()) return *code;
  if (const auto code = network.run()) return *code;
  if (plot->parsed()) return client::plot(plot_args);
  if (figures->parsed()) return client::figures(figures_args);
  if (explain->parsed()) return client::explain(explain_args);
  if (batch->parsed()) return client::batch(batch_args);
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

}  // namespace

int main(int argc, char** argv) {
  try {
    const int code = verbs(argc, argv);
    if (std::fflush(stdout) == 0 || errno == EPIPE) return code;
    std::fputs("hamel: cannot write to standard output\n", stderr);
  } catch (const std::system_error& e) {
    if (e.code() == std::errc::broken_pipe) return runtime::kDone;  // the reader has had enough
    std::fputs((std::string("hamel: ") + e.what() + "\n").c_str(), stderr);
  } catch (const std::exception& e) {
    std::fputs("hamel: ", stderr);
    std::fputs(e.what(), stderr);
    std::fputs("\n", stderr);
  }
  return runtime::kBadInput;
}
