#pragma once
/// The part of a report that is read off the pairs.

#include "services/planner/core/pairs.h"
#include "services/planner/core/planner.h"

namespace hamel::planner {

/// Each link's nearest obstacle and the forces between the two.  No allocation where out.links has n entries.
void report_links(const Pairs& pairs, const scene::PlannerOptions& options, Report& out) noexcept;

}  // namespace hamel::planner
