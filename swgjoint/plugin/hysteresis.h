// Hysteresis along the torsion: parallel Jenkin elements whose yield torque may depend
// on the elastic torque. It implements the same law as swgjoint/maps/hysteresis.py;
// README.md has the formulas.
#ifndef SWGJOINT_PLUGIN_HYSTERESIS_H_
#define SWGJOINT_PLUGIN_HYSTERESIS_H_

#include <algorithm>
#include <cmath>
#include <vector>

#include "drive_map.h"

namespace swgjoint {

class Hysteresis {
 public:
  // Reads "stiffness yield_torque" of every element and, unless it is null or empty,
  // the yield curves "n T_1 .. T_n f_11 .. f_1n f_21 ..". Returns null if both are
  // valid, otherwise what is wrong.
  const char* Parse(const char* elements, const char* curves);

  size_t size() const { return reach_.size(); }
  // Whether yield torques depend on the elastic torque.
  bool varies() const { return !torque_.empty(); }
  // Number of states: where each element is relaxed and, if yield torques vary, its
  // yield torsion in the last step, which is 0 if there was none.
  size_t states() const { return varies() ? 2 * size() : size(); }

  // Sets the stretch of every element at the torsion at the start of a step. `rest` are
  // the torsions at which they are relaxed. `limit` are the yield torsions in the last
  // step, or null if `rest` includes its slip. An element beyond its reach slips.
  void Place(double torsion, const double* rest, const double* limit) {
    for (size_t j = 0; j < reach_.size(); ++j) {
      const double stretch = torsion - rest[j];
      if (!varies()) {
        stretch_[j] = std::clamp(stretch, -reach_[j], reach_[j]);
      } else {
        stretch_[j] = limit && limit[j] > 0 ? std::clamp(stretch, -limit[j], limit[j])
                                            : stretch;
      }
    }
  }

  // Adds the contribution of the elements over a change of the torsion: their mean
  // torque, so that their work is exact, and its rate of change with the change of the
  // torsion. An element sticks over the fraction f of the change. If yield torques vary,
  // they are those at the mean elastic torque `value->torque` throughout the change. All
  // torques of the elements are multiplied by `losses`.
  //
  // The rate is the derivative of the mean torque or, if this is larger, the smallest
  // rate that keeps the element passive, whatever the torsion does in the step: the work
  // of offset + rate change is never less than minus the stored energy. With it, the
  // passes also converge where Newton's method alternates between sticking and slipping.
  void Slip(double change, double losses, DriveValue* value) {
    if (varies()) Load(value->torque);
    for (size_t j = 0; j < reach_.size(); ++j) {
      const double k = losses * stiffness_[j];
      const double begin =
          varies() ? std::clamp(stretch_[j], -reach_[j], reach_[j]) : stretch_[j];
      const double free = begin + change;
      const double end = std::clamp(free, -reach_[j], reach_[j]);
      const double f = end == free ? 1 : (end - begin) / change;
      const double mean = 0.5 * (begin + end) * f + end * (1 - f);
      double rate = 0.5 * f * f;
      if (f != 1) {
        // (mean - rate change)^2 = 2 rate begin^2, the smaller solution
        const double work = mean * change, stored = begin * begin;
        const double root = std::fabs(begin) * std::sqrt(2 * work + stored);
        const double sum = work + stored + root;
        if (sum > 0) rate = std::max(rate, mean * mean / sum);
      }
      elements_[j] = {begin, mean - rate * change, rate, f == 1};
      value->torque += k * mean;
      value->slope += k * rate;
      value->stiffness_begin += k * f;
      value->stiffness_end += k * f;
    }
  }

  // Moves the relaxed torsions by the slip in a step, after the actual change of the
  // torsion. An element stores at most its previous energy plus the work of the step.
  void Settle(double change, double* rest) const {
    for (size_t j = 0; j < reach_.size(); ++j) {
      const Element& step = elements_[j];
      const double free = step.begin + change;
      double end = std::clamp(free, -reach_[j], reach_[j]);
      if (!step.sticks) {
        const double work = (step.offset + step.rate * change) * change;
        const double most = std::sqrt(std::max(0.0, step.begin * step.begin + 2 * work));
        end = std::clamp(end, -most, most);
      }
      rest[j] += free - end;
    }
  }

  // Sets the yield torsions at an elastic torque.
  void Load(double torque);

  // Moves the relaxed torsions to what the elements allow at a torsion, first with the
  // yield torsions of the last step, unless `limit` is null, then with the current ones.
  void Relax(double torsion, const double* limit, double* rest) const;

  // Stores the current yield torsions as those of the last step.
  void Store(double* limit) const;

  // Takes over a step that another instance has begun.
  void Continue(const Hysteresis& other) {
    if (other.size() != size()) return;
    elements_ = other.elements_;
    if (varies()) reach_ = other.reach_;
  }

 private:
  // Step of one element: stretch at its start, and torque offset + rate change, both
  // divided by the stiffness.
  struct Element {
    double begin, offset, rate;
    bool sticks;
  };

  std::vector<Element> elements_;
  // stiffness, current yield torsion, and torsion relative to the relaxed state
  std::vector<double> stiffness_, reach_, stretch_;
  // yield curves: elastic torques, increasing from 0, and for each of them the yield
  // torsions of all elements
  std::vector<double> torque_, table_;
};

}  // namespace swgjoint

#endif  // SWGJOINT_PLUGIN_HYSTERESIS_H_
