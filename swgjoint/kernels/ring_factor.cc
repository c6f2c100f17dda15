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

// Elimination of loads, in place: `width` columns of `size` unknowns.
SWGJOINT_WIDE void forward(const double* matrix, std::size_t size, std::size_t pivots,
                           double* columns, std::size_t width) {
  constexpr std::size_t panel = 4;
  for (std::size_t c = 0; c < width; ++c, columns += size) {
    double* __restrict x = columns;
    std::size_t pivot = 0;
    for (; pivot + panel <= pivots; pivot += panel) {
      const double *one = matrix + pivot * size, *two = one + size, *three = two + size,
                   *four = three + size;
      const double *rows[panel] = {one, two, three, four};
      for (std::size_t k = 0; k < panel; ++k) {
        const double own = x[pivot + k] *= rows[k][pivot + k];
        for (std::size_t j = k + 1; j < panel; ++j) {
          x[pivot + j] -= rows[k][pivot + j] * own;
        }
      }
      const double a = x[pivot], b = x[pivot + 1], d = x[pivot + 2], e = x[pivot + 3];
      for (std::size_t j = pivot + panel; j < size; ++j) {
        x[j] = (((x[j] - one[j] * a) - two[j] * b) - three[j] * d) - four[j] * e;
      }
    }
    for (; pivot < pivots; ++pivot) {
      const double* row = matrix + pivot * size;
      const double own = x[pivot] *= row[pivot];
      for (std::size_t j = pivot + 1; j < size; ++j) x[j] -= row[j] * own;
    }
  }
}

// Substitution of eliminated unknowns (size,), in place.
SWGJOINT_WIDE void backward(const double* matrix, std::size_t size, std::size_t pivots,
                            double* values) {
  for (std::size_t k = pivots; k-- > 0;) {
    const double* row = matrix + k * size;
    const double sum = sum_of_products(row + k + 1, values + k + 1, size - k - 1);
    values[k] = (values[k] - sum) * row[k];
  }
}

// Adds the products of all pairs of `width` columns, over their first `count` entries, to
// the upper triangle of a matrix (total, total): the first d columns are those of the
// matrix, the others follow after `start` more.
SWGJOINT_WIDE void add_products(const double* columns, std::size_t size,
                                std::size_t count, std::size_t d, std::size_t width,
                                std::size_t start, std::size_t total, double* sum) {
  const auto place = [&](std::size_t a) { return a < d ? a : a + start; };
  for (std::size_t a = 0; a < width; ++a) {
    for (std::size_t b = a; b < width; ++b) {
      sum[place(a) * total + place(b)] +=
          sum_of_products(columns + a * size, columns + b * size, count);
    }
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

// Load of one sector (n,), with entries `apart` from each other, interior unknowns first.
void RingFactor::place(const double* load, std::size_t apart, double* to) const {
  const std::size_t f = face_, m = inner_;
  for (std::size_t j = 0; j < f; ++j) to[m + j] = load[j * apart];
  for (std::size_t j = 0; j < m; ++j) to[j] = load[(f + j) * apart];
  for (std::size_t j = m + f; j < size_; ++j) to[j] = load[j * apart];
}

void RingFactor::solve(double* loads, std::size_t width) const {
  const std::size_t n = size_, f = face_, m = inner_;
  std::vector<std::size_t> begin(parts_.size() + 1, 0);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    begin[i + 1] = begin[i] + parts_[i].size;
  }
  std::vector<double> values(begin.back());
  // values of a part at its two faces
  const auto faces = [&](std::int64_t i) {
    return values.data() + begin[i] + parts_[i].pivots;
  };
  for (std::size_t c = 0; c < width; ++c, ++loads) {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      const Part& part = parts_[i];
      double* own = values.data() + begin[i];
      if (i < sectors_) {
        place(loads + i * n * width, width, own);
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
      forward(part.matrix, part.size, part.pivots, own, 1);
    }
    for (std::size_t i = parts_.size(); i-- > 0;) {
      const Part& part = parts_[i];
      double* own = values.data() + begin[i];
      backward(part.matrix, part.size, part.pivots, own);
      if (i < sectors_) {
        double* to = loads + i * n * width;
        for (std::size_t j = 0; j < f; ++j) to[j * width] = own[m + j];
        for (std::size_t j = 0; j < m; ++j) to[(f + j) * width] = own[j];
        for (std::size_t j = m + f; j < n; ++j) to[j * width] = own[j];
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
}

void RingFactor::condense(const double* loads, std::size_t d,
                          const std::int64_t* sector, const double* rows,
                          std::size_t k, double* result) const {
  const std::size_t n = size_, f = face_, total = d + k;
  // columns of a part: the loads on all sectors, then the rows on its own sectors
  std::vector<std::size_t> order(k), begin(sectors_ + 1, 0);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return sector[a] < sector[b];
  });
  for (std::size_t i = 0; i < k; ++i) ++begin[sector[i] + 1];
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  const auto width_of = [&](const Part& part) {
    return d + begin[part.last] - begin[part.first];
  };
  std::vector<std::size_t> at(parts_.size() + 1, 0);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    at[i + 1] = at[i] + parts_[i].size * width_of(parts_[i]);
  }
  std::vector<double> gram(total * total, 0.0), values(at.back(), 0.0);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    const std::size_t start = begin[part.first], width = width_of(part);
    double* own = values.data() + at[i];
    if (i < sectors_) {
      for (std::size_t c = 0; c < d; ++c) place(loads + i * n * d + c, d, own + c * n);
      for (std::size_t c = d; c < width; ++c) {
        place(rows + order[start + c - d] * n, 1, own + c * n);
      }
    } else {
      // loads of a child on its faces, at given rows of the part
      const auto take = [&](std::int64_t child, std::size_t first, std::size_t last) {
        const Part& from = parts_[child];
        const std::size_t before = begin[from.first] - start, count = width_of(from);
        for (std::size_t c = 0; c < count; ++c) {
          const double* faces = values.data() + at[child] + c * from.size + from.pivots;
          double* to = own + (c < d ? c : c + before) * part.size;
          add_to(to + first, faces, f);
          add_to(to + last, faces + f, f);
        }
      };
      if (part.right >= 0) {
        take(part.left, f, 0);
        take(part.right, 0, 2 * f);
      } else {
        take(part.left, 0, 0);
      }
    }
    forward(part.matrix, part.size, part.pivots, own, width);
    add_products(own, part.size, part.pivots, d, width, start, total, gram.data());
  }
  const auto number = [&](std::size_t a) { return a < d ? a : d + order[a - d]; };
  for (std::size_t a = 0; a < total; ++a) {
    for (std::size_t b = a; b < total; ++b) {
      const std::size_t i = number(a), j = number(b);
      result[i * total + j] = result[j * total + i] = gram[a * total + b];
    }
  }
}

}  // namespace swgjoint
