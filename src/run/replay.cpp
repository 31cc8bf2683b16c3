#include <cstring>
#include <iostream>

#include "error.hpp"
#include "output/sealed.hpp"
#include "run/record.hpp"
#include "run/runner.hpp"

namespace moraine::run {

namespace {

// Where two series part: " from stage 2, step 1200 on"; empty: nowhere.
std::string first_difference(const std::vector<output::Row>& a, const std::vector<output::Row>& b) {
  for (std::size_t k = 0; k < std::max(a.size(), b.size()); ++k) {
    if (k < a.size() && k < b.size() && std::memcmp(&a[k], &b[k], sizeof(output::Row)) == 0) continue;
    const output::Row& row = k < a.size() ? a[k] : b[k];
    return text(" from stage ", row.stage + 1, ", step ", row.step, " on");
  }
  return "";
}

}  // namespace

void replay_case(const Options& options) {
  if (!options.overrides.empty())
    throw error("--set ", options.overrides[0].key,
                ": a replay runs what was run, and takes no other values");
  const Files original{options.directory / "output"};
  const output::Checkpoint before = output::read_checkpoint(original.checkpoint());
  catch_signals();
  Options again = options;
  again.output = options.directory / "replay" / "output", again.events = before.events;
  const cases::Case c = cases::load_resolved(options.directory, before.case_text);
  Runner runner(again, c);
  const auto stage = static_cast<std::size_t>(before.stage);
  while (!runner.finished() && runner.stage_index() < stage)
    runner.stage_ended() ? runner.begin_stage() : void(runner.step(runner.steps()));
  if (before.finished)
    runner.finish();
  else if (!runner.finished())
    runner.step(before.state.step - runner.step_number()), runner.checkpoint();

  const std::string where = runner.files().checkpoint().string() + " and " + original.checkpoint().string();
  if (output::digest_of_file(runner.files().checkpoint()) != output::digest_of_file(original.checkpoint())) {
    const std::string from = first_difference(before.rows, runner.rows());
    throw error(
        where, " differ: ", from.empty() ? "but not in the series" : "the series" + from,
        "; expected the same bits. Has the program, a file that the case reads, or an interval of output "
        "changed since?");
  }
  std::cout << "the same bits, with " << before.events.size()
            << (before.events.size() == 1 ? " event and " : " events and ") << before.rows.size()
            << " rows: " << where << "\n";
}

}  // namespace moraine::run
