#include "hysteresis.h"

#include <cmath>
#include <limits>

namespace swgjoint {
namespace {

constexpr size_t kMaxElements = 64;
constexpr char kElements[] =
    "attribute 'hysteresis' is not up to 64 pairs of numbers > 0";
constexpr char kCurves[] =
    "attribute 'yield_curve' is not a number n > 1, n torques that increase from 0, and "
    "n yield torques >= 0 for each element";

}  // namespace

const char* Hysteresis::Parse(const char* elements, const char* curves) {
  stiffness_.clear();
  reach_.clear();
  torque_.clear();
  table_.clear();
  std::vector<double> list;
  const bool vary = curves && *curves;
  if (elements && *elements) {
    if (!ParseNumbers(elements, &list) || list.size() % 2 ||
        list.size() > 2 * kMaxElements) {
      return kElements;
    }
    for (size_t j = 0; j < list.size(); j += 2) {
      // an element with a yield curve may yield without torque
      if (!(list[j] > 0 && (list[j + 1] > 0 || (vary && list[j + 1] == 0)))) {
        return kElements;
      }
      stiffness_.push_back(list[j]);
      reach_.push_back(list[j + 1] / list[j]);
    }
  }
  stretch_.assign(reach_.size(), 0.0);
  elements_.assign(reach_.size(), {});
  if (!vary) return nullptr;

  if (!ParseNumbers(curves, &list) || list[0] < 2 || list[0] > list.size() ||
      list[0] != std::rint(list[0])) {
    return kCurves;
  }
  const size_t n = static_cast<size_t>(list[0]), count = reach_.size();
  if (count == 0 || list.size() != 1 + n * (1 + count) || list[1] != 0) return kCurves;
  for (size_t k = 2; k <= n; ++k) {
    if (!(list[k] > list[k - 1])) return kCurves;
  }
  if (!std::all_of(list.begin() + 1, list.end(), [](double x) { return x >= 0; })) {
    return kCurves;
  }
  torque_.assign(list.begin() + 1, list.begin() + 1 + n);
  for (size_t k = 0; k < n; ++k) {
    for (size_t j = 0; j < count; ++j) {
      table_.push_back(list[1 + n * (1 + j) + k] / stiffness_[j]);
    }
  }
  return nullptr;
}

void Hysteresis::Load(double torque) {
  const double size = std::fabs(torque);
  size_t k = 0;
  while (k + 2 < torque_.size() && size >= torque_[k + 1]) ++k;
  const double part =
      std::min(1.0, (size - torque_[k]) / (torque_[k + 1] - torque_[k]));
  const size_t count = reach_.size();
  const double* low = table_.data() + k * count;
  for (size_t j = 0; j < count; ++j) {
    reach_[j] = low[j] + part * (low[j + count] - low[j]);
  }
}

void Hysteresis::Relax(double torsion, const double* limit, double* rest) const {
  for (size_t j = 0; j < reach_.size(); ++j) {
    if (limit && limit[j] > 0) {
      rest[j] = std::clamp(rest[j], torsion - limit[j], torsion + limit[j]);
    }
    rest[j] = std::clamp(rest[j], torsion - reach_[j], torsion + reach_[j]);
  }
}

void Hysteresis::Store(double* limit) const {
  // positive even without reach, because 0 means that there was no step
  for (size_t j = 0; j < reach_.size(); ++j) {
    limit[j] = std::max(reach_[j], std::numeric_limits<double>::min());
  }
}

}  // namespace swgjoint
