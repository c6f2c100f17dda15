#include "ring_factor.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "wide.h"

namespace swgjoint {

namespace {

// Subtracts from rows begin to end - 1 of an upper triangle the products of `panel`
// eliminated rows.
template <int panel>
SWGJOINT_INLINE void subtract(double* matrix, std::size_t size, std::size_t pivot, std::size_t begin) {
  const double* source[panel];
  for (int k = 0; k < panel; ++k) source[k] = matrix + (pivot + k) * size;
  for (std::size_t i = begin; i < size; ++i) {
    double* row = matrix + i * size;
    double factor[panel];
    for (int k = 0; k < panel; ++k) factor[k] = source[k][i];
    for (std::size_t j = i; j < size; ++j) {
      double value = row[j];
      for (int k = 0; k < panel; ++k) value -= factor[k] * source[k][j];
      row[j] = value;
    }
  }
}

// Scales the pivot row; false if the pivot is not positive.
SWGJOINT_INLINE bool scale(double* matrix, std::size_t size, std::size_t pivot) {
  double* row = matrix + pivot * size;
  if (!(row[pivot] > 0.0)) return false;
  const double inverse = 1.0 / std::sqrt(row[pivot]);
  row[pivot] = inverse;
  for (std::size_t j = pivot + 1; j < size; ++j) row[j] *= inverse;
  return true;
}

// Partial Cholesky factorisation of the upper triangle of a matrix, in place.
SWGJOINT_WIDE bool factorise(double* matrix, std::size_t size, std::size_t pivots) {
  constexpr int panel = 4;
  std::size_t pivot = 0;
  for (; pivot + panel <= pivots; pivot += panel) {
    for (std::size_t k = pivot; k < pivot + panel; ++k) {
      if (!scale(matrix, size, k)) return false;
      // only the rest of the panel; the other rows follow at once
      for (std::size_t i = k + 1; i < pivot + panel; ++i) {
        const double factor = matrix[k * size + i];
        const double* source = matrix + k * size;
        double* row = matrix + i * size;
        for (std::size_t j = i; j < size; ++j) row[j] -= factor * source[j];
      }
    }
    subtract<panel>(matrix, size, pivot, pivot + panel);
  }
  for (; pivot < pivots; ++pivot) {
    if (!scale(matrix, size, pivot)) return false;
    subtract<1>(matrix, size, pivot, pivot + 1);
  }
  return true;
}

// Elimination of a few loads (size, width), in place: the compiler unrolls their loop.
template <int width>
void forward_few(const double* matrix, std::size_t size, std::size_t pivots,
                 double* loads) {
  for (std::size_t k = 0; k < pivots; ++k) {
    const double* row = matrix + k * size;
    double own[width];
    for (int c = 0; c < width; ++c) {
      own[c] = loads[k * width + c] *= row[k];
    }
    for (std::size_t j = k + 1; j < size; ++j) {
      for (int c = 0; c < width; ++c) loads[j * width + c] -= row[j] * own[c];
    }
  }
}

// Elimination of loads (size, width), in place.
void forward(const double* matrix, std::size_t size, std::size_t pivots, double* loads,
             std::size_t width) {
  if (width == 1) return forward_few<1>(matrix, size, pivots, loads);
  if (width == 2) return forward_few<2>(matrix, size, pivots, loads);
  if (width == 3) return forward_few<3>(matrix, size, pivots, loads);
  if (width == 4) return forward_few<4>(matrix, size, pivots, loads);
  for (std::size_t k = 0; k < pivots; ++k) {
    const double* row = matrix + k * size;
    double* own = loads + k * width;
    for (std::size_t c = 0; c < width; ++c) own[c] *= row[k];
    for (std::size_t j = k + 1; j < size; ++j) {
      double* other = loads + j * width;
      for (std::size_t c = 0; c < width; ++c) other[c] -= row[j] * own[c];
    }
  }
}

// Sum of products, in four parts that do not wait for each other.
double dot(const double* a, const double* b, std::size_t count) {
  double sum[4] = {0.0, 0.0, 0.0, 0.0};
  std::size_t i = 0;
  for (; i + 4 <= count; i += 4) {
    for (int k = 0; k < 4; ++k) sum[k] += a[i + k] * b[i + k];
  }
  for (; i < count; ++i) sum[0] += a[i] * b[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

// Substitution of eliminated unknowns (size, width), in place.
void backward(const double* matrix, std::size_t size, std::size_t pivots, double* values,
              std::size_t width) {
  for (std::size_t k = pivots; k-- > 0;) {
    const double* row = matrix + k * size;
    double* own = values + k * width;
    if (width == 1) {
      *own = (*own - dot(row + k + 1, values + k + 1, size - k - 1)) * row[k];
      continue;
    }
    for (std::size_t j = k + 1; j < size; ++j) {
      const double* other = values + j * width;
      for (std::size_t c = 0; c < width; ++c) own[c] -= row[j] * other[c];
    }
    for (std::size_t c = 0; c < width; ++c) own[c] *= row[k];
  }
}

void add_to(double* sum, const double* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) sum[i] += values[i];
}

}  // namespace

RingFactor::RingFactor(std::size_t sectors, std::size_t size, std::size_t face)
    : sectors_(sectors), size_(size), face_(face), inner_(size - 2 * face) {
  parts_.reserve(2 * sectors);
  for (std::size_t s = 0; s < sectors; ++s) {
    parts_.push_back({s, s + 1, inner_, size, -1, -1, nullptr});
  }
  const std::int64_t top = add(0, sectors);
  parts_.push_back({0, sectors, face, face, top, -1, nullptr});
  std::size_t total = 0;
  for (const Part& part : parts_) total += part.size * part.size;
  // not cleared: only the upper triangles are used, and they are always filled
  memory_.reset(new double[total]);
  double* matrix = memory_.get();
  for (Part& part : parts_) {
    part.matrix = matrix;
    matrix += part.size * part.size;
  }
}

// Adds the merges of a range of sectors; number of the part that covers it.
std::int64_t RingFactor::add(std::size_t first, std::size_t last) {
  if (last - first == 1) return static_cast<std::int64_t>(first);
  const std::size_t middle = first + (last - first) / 2;
  const std::int64_t left = add(first, middle), right = add(middle, last);
  parts_.push_back({first, last, face_, 3 * face_, left, right, nullptr});
  return static_cast<std::int64_t>(parts_.size()) - 1;
}

bool RingFactor::eliminate(Part& part) const {
  return factorise(part.matrix, part.size, part.pivots);
}

// Upper triangle of a sector's block, interior unknowns first.
void RingFactor::gather(Part& part, const double* block) const {
  const std::size_t n = size_, f = face_, m = inner_;
  double* to = part.matrix;
  for (std::size_t i = 0; i < m; ++i, to += n) {
    const double* row = block + (f + i) * n;
    std::copy(row + f + i, row + f + m, to + i);
    std::copy(row, row + f, to + m);
    std::copy(row + f + m, row + n, to + m + f);
  }
  for (std::size_t i = 0; i < f; ++i, to += n) {
    const double* row = block + i * n;
    std::copy(row + i, row + f, to + m + i);
    std::copy(row + f + m, row + n, to + m + f);
  }
  for (std::size_t i = 0; i < f; ++i, to += n) {
    const double* row = block + (f + m + i) * n;
    std::copy(row + f + m + i, row + n, to + m + f + i);
  }
}

// Matrix of two neighbouring parts, the face between them first.
void RingFactor::merge(Part& part) const {
  const Part &left = parts_[part.left], &right = parts_[part.right];
  const std::size_t f = face_, size = part.size;
  const std::size_t nl = left.size, nr = right.size, pl = left.pivots, pr = right.pivots;
  const double *l = left.matrix, *r = right.matrix;
  double* to = part.matrix;
  for (std::size_t i = 0; i < f; ++i) {
    double* middle = to + i * size;
    double* first = to + (f + i) * size;
    double* last = to + (2 * f + i) * size;
    for (std::size_t j = i; j < f; ++j) {
      middle[j] = l[(pl + f + i) * nl + pl + f + j] + r[(pr + i) * nr + pr + j];
      first[f + j] = l[(pl + i) * nl + pl + j];
      last[2 * f + j] = r[(pr + f + i) * nr + pr + f + j];
    }
    for (std::size_t j = 0; j < f; ++j) {
      middle[f + j] = l[(pl + j) * nl + pl + f + i];
      middle[2 * f + j] = r[(pr + i) * nr + pr + f + j];
      first[2 * f + j] = 0.0;
    }
  }
}

// Matrix of the only face that is left when the ring is closed.
void RingFactor::close() {
  Part& ring = parts_.back();
  const Part& top = parts_[ring.left];
  const std::size_t f = face_, n = top.size, p = top.pivots;
  const double* from = top.matrix;
  for (std::size_t i = 0; i < f; ++i) {
    for (std::size_t j = i; j < f; ++j) {
      ring.matrix[i * f + j] =
          from[(p + i) * n + p + j] + from[(p + f + i) * n + p + f + j] +
          from[(p + i) * n + p + f + j] + from[(p + j) * n + p + f + i];
    }
  }
}

bool RingFactor::update(const double* blocks, const std::int64_t* changed,
                        std::size_t count) {
  std::vector<char> stale(parts_.size(), 0);
  for (std::size_t i = 0; i < count; ++i) stale[changed[i]] = 1;
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    Part& part = parts_[i];
    if (i < sectors_) {
      if (!stale[i]) continue;
      gather(part, blocks + i * size_ * size_);
    } else if (part.right >= 0) {
      if (!stale[part.left] && !stale[part.right]) continue;
      stale[i] = 1;
      merge(part);
    } else {
      if (!stale[part.left]) continue;
      close();
    }
    if (!eliminate(part)) return false;
  }
  return true;
}

void RingFactor::solve(double* loads, std::size_t width) const {
  const std::size_t n = size_, f = face_ * width, m = inner_ * width;
  std::vector<std::size_t> begin(parts_.size() + 1, 0);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    begin[i + 1] = begin[i] + parts_[i].size * width;
  }
  std::vector<double> values(begin.back());
  // values of a part at its two faces
  const auto faces = [&](std::int64_t i) {
    return values.data() + begin[i] + parts_[i].pivots * width;
  };
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    double* own = values.data() + begin[i];
    if (i < sectors_) {
      const double* from = loads + i * n * width;
      std::copy(from, from + f, own + m);
      std::copy(from + f, from + f + m, own);
      std::copy(from + f + m, from + n * width, own + m + f);
    } else {
      const double* left = faces(part.left);
      if (part.right >= 0) {
        const double* right = faces(part.right);
        std::copy(left + f, left + 2 * f, own);
        add_to(own, right, f);
        std::copy(left, left + f, own + f);
        std::copy(right + f, right + 2 * f, own + 2 * f);
      } else {
        std::copy(left, left + f, own);
        add_to(own, left + f, f);
      }
    }
    forward(part.matrix, part.size, part.pivots, own, width);
  }
  for (std::size_t i = parts_.size(); i-- > 0;) {
    const Part& part = parts_[i];
    double* own = values.data() + begin[i];
    backward(part.matrix, part.size, part.pivots, own, width);
    if (i < sectors_) {
      double* to = loads + i * n * width;
      std::copy(own + m, own + m + f, to);
      std::copy(own, own + m, to + f);
      std::copy(own + m + f, own + n * width, to + f + m);
      continue;
    }
    double* left = faces(part.left);
    if (part.right >= 0) {
      double* right = faces(part.right);
      std::copy(own + f, own + 2 * f, left);
      std::copy(own, own + f, left + f);
      std::copy(own, own + f, right);
      std::copy(own + 2 * f, own + 3 * f, right + f);
    } else {
      std::copy(own, own + f, left);
      std::copy(own, own + f, left + f);
    }
  }
}

void RingFactor::condense(const double* loads, std::size_t d,
                          const std::int64_t* sector, const double* rows,
                          std::size_t k, double* result) const {
  const std::size_t n = size_, f = face_, m = inner_, total = d + k;
  // columns of a part: the loads on all sectors, then the rows on its own sectors
  std::vector<std::size_t> order(k), begin(sectors_ + 1, 0);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return sector[a] < sector[b];
  });
  for (std::size_t i = 0; i < k; ++i) ++begin[sector[i] + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  std::vector<double> gram(total * total, 0.0);
  std::vector<std::vector<double>> values(parts_.size());
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    const std::size_t start = begin[part.first], own_rows = begin[part.last] - start;
    const std::size_t width = d + own_rows;
    if (width == 0) continue;
    std::vector<double>& own = values[i];
    own.assign(part.size * width, 0.0);
    if (i < sectors_) {
      for (std::size_t j = 0; j < n; ++j) {
        // interior unknowns first
        const std::size_t at = j < f ? m + j : j < f + m ? j - f : j;
        double* to = own.data() + at * width;
        const double* from = loads + (i * n + j) * d;
        std::copy(from, from + d, to);
        for (std::size_t c = 0; c < own_rows; ++c) {
          to[d + c] = rows[order[start + c] * n + j];
        }
      }
    } else {
      // loads of a child on its faces, at given rows of the part
      const auto take = [&](std::int64_t child, std::size_t first, std::size_t last) {
        const Part& from = parts_[child];
        const std::size_t there = begin[from.first], count = begin[from.last] - there;
        if (d + count == 0) return;
        const double* at = values[child].data() + from.pivots * (d + count);
        for (std::size_t side = 0; side < 2; ++side) {
          for (std::size_t j = 0; j < f; ++j, at += d + count) {
            double* to = own.data() + ((side ? last : first) + j) * width;
            add_to(to, at, d);
            add_to(to + d + there - start, at + d, count);
          }
        }
        values[child].clear();
      };
      if (part.right >= 0) {
        take(part.left, f, 0);
        take(part.right, 0, 2 * f);
      } else {
        take(part.left, 0, 0);
      }
    }
    forward(part.matrix, part.size, part.pivots, own.data(), width);
    for (std::size_t j = 0; j < part.pivots; ++j) {
      const double* row = own.data() + j * width;
      for (std::size_t a = 0; a < width; ++a) {
        double* to = gram.data() + (a < d ? a : a + start) * total;
        for (std::size_t b = a; b < d; ++b) to[b] += row[a] * row[b];
        for (std::size_t b = std::max(a, d); b < width; ++b) {
          to[start + b] += row[a] * row[b];
        }
      }
    }
  }
  const auto place = [&](std::size_t a) { return a < d ? a : d + order[a - d]; };
  for (std::size_t a = 0; a < total; ++a) {
    for (std::size_t b = a; b < total; ++b) {
      const std::size_t i = place(a), j = place(b);
      result[i * total + j] = result[j * total + i] = gram[a * total + b];
    }
  }
}

}  // namespace swgjoint
