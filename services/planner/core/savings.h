#pragma once
/// Distances that need not be measured because nothing went far since they were.

namespace hamel::planner {

struct Savings {
  bool far_links = false;  ///< those of two links that cannot have come into range: the output is the same
  /// > 0: a link out of range of all obstacles keeps the distance it reports until it and what moves may have
  /// gone so far, or into range [m].  Commands are the same; distances reported are off by it at most.
  double requery_m = 0;
};

}  // namespace hamel::planner
