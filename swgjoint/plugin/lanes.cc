#include "lanes.h"

namespace swgjoint {

#define SWGJOINT_FILL(x) {x, x, x, x, x, x, x, x}
alignas(64) static const double kTable[kSincTerms + kCosTerms][kWideLanes] = {
    // sin(x)/x
    SWGJOINT_FILL(1), SWGJOINT_FILL(-1. / 6), SWGJOINT_FILL(1. / 120),
    SWGJOINT_FILL(-1. / 5040), SWGJOINT_FILL(1. / 362880),
    SWGJOINT_FILL(-1. / 39916800), SWGJOINT_FILL(1. / 6227020800),
    // cos(x)
    SWGJOINT_FILL(1), SWGJOINT_FILL(-1. / 2), SWGJOINT_FILL(1. / 24),
    SWGJOINT_FILL(-1. / 720), SWGJOINT_FILL(1. / 40320),
    SWGJOINT_FILL(-1. / 3628800), SWGJOINT_FILL(1. / 479001600),
    SWGJOINT_FILL(-1. / 87178291200)};
const double* const kSeries = kTable[0];

}  // namespace swgjoint
