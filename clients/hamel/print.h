#pragma once
/// An outcome for people and for machines.

#include "clients/hamel/monitor.h"

namespace hamel::client {

/// One JSON object on stdout; numbers that do not exist are null.
void print_json(const scene::Scene& scene, const Outcome& o);
/// A table on stdout.
void print_table(const scene::Scene& scene, const Outcome& o, const std::string& pace,
                 const std::string& bus);

}  // namespace hamel::client
