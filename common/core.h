#pragma once
/// hamel::core in one header: the mathematics, without any middleware.

#include "common/base/result.h"
#include "common/geometry/shape.h"
#include "common/lie/se2.h"
#include "common/lie/se3.h"
#include "common/model/chain.h"
#include "common/model/screws.h"
#include "common/rbd/rbd.h"
#include "common/scene/options.h"
#include "common/scene/scene.h"
#include "services/dynamics/core/discrete_inverse.h"
#include "services/dynamics/core/integrator.h"
#include "services/planner/core/planner.h"
