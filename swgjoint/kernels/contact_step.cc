#include "contact_step.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "dense_factors.h"

namespace swgjoint {
namespace {

using Values = std::vector<double>;
using Numbers = std::vector<std::size_t>;

// TRIES and PATIENCE of complementarity.py
constexpr int kTries = 120, kPatience = 3;
constexpr double kTolerance = 1e-12, kTiny = 1e-300;

// A square matrix with a right-hand side for some of its rows and columns.
class Subsystem {
 public:
  // Solution of matrix (size, size) restricted to rows and columns; false if singular.
  bool solve(const Values& matrix, std::size_t size, const Numbers& index,
             const Values& right, Values* solution) {
    const std::size_t n = index.size(), stride = n + 1 + kPadding;
    rows_.assign(n * stride, 0.0);
    pivots_.resize(n);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t j = 0; j < n; ++j) {
        rows_[stride * i + j] = matrix[size * index[i] + index[j]];
      }
      rows_[stride * i + n] = right[index[i]];
    }
    if (n > 0 && !eliminate(rows_.data(), n, n + 1, stride, pivots_.data())) return false;
    solution->assign(size, 0.0);
    for (std::size_t i = 0; i < n; ++i) (*solution)[index[i]] = rows_[stride * i + n];
    return true;
  }

 private:
  Values rows_;
  Numbers pivots_;
};

// Matrix and offset of the condensed system, as NewtonProblem._matrix and _offset.
void condense(const ContactStep& step, const double* products, Values* matrix,
              Values* offset) {
  const std::size_t n = step.lines, size = n + 3, constrained[2] = {n, n + 2};
  matrix->assign(size * size, 0.0);
  offset->assign(size, 0.0);
  double* m = matrix->data();
  for (std::size_t i = 0; i < n; ++i) {
    const double* row = products + size * (i + 3);
    for (std::size_t j = 0; j < n; ++j) {
      m[size * i + j] = row[j + 3] + step.compliance[n * i + j];
    }
    for (std::size_t k = 0; k < 2; ++k) {
      m[size * i + constrained[k]] = row[k + 1];
      m[size * constrained[k] + i] = products[size * (k + 1) + i + 3];
    }
    m[size * i + n + 1] = m[size * (n + 1) + i] = -step.arm[i];
    (*offset)[i] = step.gap[i] + products[i + 3];
  }
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t l = 0; l < 2; ++l) {
      m[size * constrained[k] + constrained[l]] = products[size * (k + 1) + l + 1];
    }
    (*offset)[constrained[k]] = products[k + 1];
  }
  m[size * n + n] -= 1.0 / step.anchor_stiffness;
  (*offset)[n + 1] = step.moment;
  (*offset)[n + 2] += step.rotation;
}

}  // namespace

bool solve_contact_step(const ContactStep& step, const double* products, bool* active,
                        double* result, double* output_compliance) {
  const std::size_t n = step.lines, size = n + 3;
  Values matrix, offset, z;
  condense(step, products, &matrix, &offset);
  Numbers used;  // the last ones are free
  for (std::size_t i = 0; i <= n; ++i) used.push_back(i);
  if (step.turns) used.push_back(n + 1);
  if (step.held) used.push_back(n + 2);

  // scaled so that the forces have a unit diagonal
  Values scale(size, 1.0);
  for (const std::size_t i : used) scale[i] = std::sqrt(std::abs(matrix[size * i + i])) + kTiny;
  if (n > 0) {  // the diagonal of a free unknown may vanish
    for (const std::size_t i : used) {
      if (i < n) continue;
      for (std::size_t j = 0; j < n; ++j) {
        scale[i] = std::max(scale[i], std::abs(matrix[size * i + j] / scale[j]));
      }
    }
  }
  Values scaled(size * size), q(size), right(size);
  double largest = kTiny;
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j < size; ++j) {
      scaled[size * i + j] = matrix[size * i + j] / scale[i] / scale[j];
    }
    q[i] = offset[i] / scale[i];
    right[i] = -q[i];
  }
  for (const std::size_t i : used) largest = std::max(largest, std::abs(q[i]));
  const double tolerance = kTolerance * largest;

  Subsystem system;
  Numbers index;
  const auto gather = [&] {
    index.clear();
    for (const std::size_t i : used) {
      if (i >= n || active[i]) index.push_back(i);
    }
  };
  bool settled = false;
  std::size_t fewest = n + 1;
  int patience = kPatience;
  Numbers bad;
  for (int k = 0; k < kTries && !settled; ++k) {
    gather();
    if (!system.solve(scaled, size, index, right, &z)) return false;
    bad.clear();
    std::size_t worst = 0;
    double most = tolerance;
    for (std::size_t i = 0; i < n; ++i) {
      double wrong = -z[i];
      if (!active[i]) {
        wrong = -q[i];
        for (const std::size_t j : index) wrong -= scaled[size * i + j] * z[j];
      }
      if (!(wrong > tolerance)) continue;
      bad.push_back(i);
      if (wrong > most) {
        most = wrong;
        worst = i;
      }
    }
    settled = bad.empty();
    if (bad.size() < fewest) {
      fewest = bad.size();
      patience = kPatience;
    } else if (patience > 0) {
      --patience;
    } else if (!settled) {
      bad.assign(1, worst);
    }
    for (const std::size_t i : bad) active[i] = !active[i];
  }
  if (!settled) return false;
  for (std::size_t i = 0; i < size; ++i) result[i] = z[i] / scale[i];

  // tangent compliance of the output, as output_compliance
  gather();
  Values response;
  if (step.turns) {
    Values unit(size, 0.0);
    unit[n + 1] = 1.0;
    if (!system.solve(matrix, size, index, unit, &response)) return false;
    *output_compliance = -response[n + 1];
    return true;
  }
  if (step.held) index.pop_back();
  Values reach(size);
  for (std::size_t i = 0; i < size; ++i) reach[i] = matrix[size * i + n + 2];
  if (!system.solve(matrix, size, index, reach, &response)) return false;
  double sum = 0.0;
  for (const std::size_t i : index) sum += matrix[size * (n + 2) + i] * response[i];
  *output_compliance = matrix[size * (n + 2) + n + 2] - sum;
  return true;
}

}  // namespace swgjoint
