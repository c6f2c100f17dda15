#include "ring_factor.h"

#include <algorithm>
#include <numeric>

#include "eight_lanes.h"
#include "wide.h"

namespace swgjoint {

namespace {

void add_to(double* sum, const double* values, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) sum[i] += values[i];
}

// Short rows: a call of memcpy takes longer than the copy.
SWGJOINT_INLINE double* copy_row(const double* from, std::size_t count, double* to) {
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    lanes_at(to + i) = lanes_at(from + i);
  }
  for (; i + 2 <= count; i += 2) std::memcpy(to + i, from + i, 2 * sizeof(double));
  if (i < count) to[i] = from[i];
  return to + count;
}

// Zeros in the columns from begin to end.
void clear(double* rows, std::size_t count, std::size_t stride, std::size_t begin,
           std::size_t end) {
  for (std::size_t i = 0; i < count; ++i) {
    std::fill(rows + i * stride + begin, rows + i * stride + end, 0.0);
  }
}

}  // namespace

bool RingFactor::Reduced::holds(const std::int64_t* others, const double* their_rows,
                                std::size_t count, std::size_t n,
                                std::size_t all) const {
  return values != nullptr && count == k && all * n == loads.size() &&
         std::equal(sector.begin(), sector.end(), others) &&
         std::equal(rows.begin(), rows.end(), their_rows);
}

RingFactor::RingFactor(std::size_t sectors, std::size_t size, std::size_t face)
    : sectors_(sectors), size_(size), face_(face), inner_(size - 2 * face) {
  parts_.resize(sectors);
  const std::int64_t top = add(0, sectors, false);
  const PartialCholesky ring = {face, 0, padded(face), 0, nullptr, nullptr};
  parts_.push_back({0, sectors, top, -1, false, ring});
  order_.push_back(parts_.size() - 1);
  changed_.assign(parts_.size(), 1);
  // tiles at the end of a row read up to kLanes numbers after it
  std::size_t total = kLanes;
  for (const Part& part : parts_) {
    total += part.matrix.pivots * part.matrix.stride;
    total += part.matrix.rest * part.matrix.rest_stride;
  }
  memory_.reset(new double[total + kLanes]);  // with room to align the first row
  double* next = memory_.get();
  while (reinterpret_cast<std::uintptr_t>(next) % (kLanes * sizeof(double))) ++next;
  for (const std::size_t i : order_) {
    PartialCholesky& matrix = parts_[i].matrix;
    matrix.factor = next;
    matrix.schur = next += matrix.pivots * matrix.stride;
    next += matrix.rest * matrix.rest_stride;
    // unused entries take part in the arithmetic: denormal numbers there would slow it
    const std::size_t size = matrix.pivots + matrix.rest;
    clear(matrix.factor, matrix.pivots, matrix.stride, size, matrix.stride);
    clear(matrix.schur, matrix.rest, matrix.rest_stride, matrix.rest, matrix.rest_stride);
    clear(matrix.schur + matrix.rest / 2 * matrix.rest_stride, matrix.rest / 2,
          matrix.rest_stride, face / kLanes * kLanes, face);
  }
}

// Adds the merges of a range of sectors; number of the part that covers it.
std::int64_t RingFactor::add(std::size_t first, std::size_t last, bool turned) {
  const std::size_t rest = 2 * face_;
  PartialCholesky matrix = {inner_, rest, padded(size_), padded(rest), nullptr, nullptr};
  if (last - first == 1) {
    parts_[first] = {first, last, -1, -1, turned, matrix};
    order_.push_back(first);
    return static_cast<std::int64_t>(first);
  }
  matrix.pivots = face_;
  matrix.stride = padded(face_ + rest);
  const std::size_t middle = first + (last - first) / 2;
  const std::int64_t left = add(first, middle, true), right = add(middle, last, false);
  parts_.push_back({first, last, left, right, turned, matrix});
  order_.push_back(parts_.size() - 1);
  return static_cast<std::int64_t>(parts_.size()) - 1;
}

// Matrix of a sector from its block.
SWGJOINT_WIDE void RingFactor::gather(const Part& part, const double* block) const {
  const PartialCholesky& matrix = part.matrix;
  const std::size_t n = size_, f = face_, m = inner_;
  const std::size_t near = part.turned ? f + m : 0, far = part.turned ? 0 : f + m;
  for (std::size_t i = 0; i < m; ++i) {
    const double* row = block + (f + i) * n;
    double* to = matrix.factor + i * matrix.stride;
    copy_row(row + far, f, copy_row(row + near, f, copy_row(row + f, m, to)));
  }
  for (std::size_t i = 0; i < f; ++i) {
    const double* row = block + (near + i) * n;
    double* to = matrix.schur + i * matrix.rest_stride;
    copy_row(row + far, f, copy_row(row + near, f, to));
    copy_row(block + (far + i) * n + far, f, to + f * (matrix.rest_stride + 1));
  }
}

// Matrix of two neighbouring parts, which eliminates the face between them.
SWGJOINT_WIDE void RingFactor::merge(const Part& part) const {
  const PartialCholesky &matrix = part.matrix, &left = parts_[part.left].matrix,
                        &right = parts_[part.right].matrix;
  const PartialCholesky &near = part.turned ? right : left,
                        &far = part.turned ? left : right;
  const std::size_t f = face_;
  for (std::size_t i = 0; i < f; ++i) {
    const std::size_t at = i * near.rest_stride, below = at + f * (near.rest_stride + 1);
    double* to = matrix.factor + i * matrix.stride;
    for (std::size_t j = 0; j < f; ++j) to[j] = near.schur[at + j] + far.schur[at + j];
    copy_row(far.schur + at + f, f, copy_row(near.schur + at + f, f, to + f));
    double* rest = matrix.schur + i * matrix.rest_stride;
    copy_row(near.schur + below, f, rest);
    for (std::size_t j = 0; j < f; ++j) rest[f + j] = 0.0;
    copy_row(far.schur + below, f, rest + f * (matrix.rest_stride + 1));
  }
}

// Matrix of the only face that is left when the ring is closed.
void RingFactor::close(const Part& ring) const {
  const PartialCholesky& top = parts_[ring.left].matrix;
  const std::size_t f = face_, n = top.rest_stride;
  for (std::size_t i = 0; i < f; ++i) {
    for (std::size_t j = i; j < f; ++j) {
      ring.matrix.factor[i * ring.matrix.stride + j] =
          top.schur[i * n + j] + top.schur[(f + i) * n + f + j] +
          top.schur[i * n + f + j] + top.schur[j * n + f + i];
    }
  }
}

bool RingFactor::update(const double* blocks, const std::int64_t* changed,
                        std::size_t count) {
  std::vector<char> stale(parts_.size(), 0);
  for (std::size_t i = 0; i < count; ++i) stale[changed[i]] = 1;
  for (const std::size_t i : order_) {
    const Part& part = parts_[i];
    if (i >= sectors_) {
      stale[i] = stale[part.left] || (part.right >= 0 && stale[part.right]);
    }
    if (!stale[i]) continue;
    changed_[i] = 1;
    if (i < sectors_) {
      gather(part, blocks + i * size_ * size_);
    } else if (part.right >= 0) {
      merge(part);
    } else {
      close(part);
    }
    if (!eliminate_first(part.matrix)) return false;
  }
  return true;
}

// Place of an unknown of a sector in its matrix.
std::size_t RingFactor::place(const Part& part, std::size_t row) const {
  if (row >= face_ && row < face_ + inner_) return row - face_;
  const bool last = row >= face_;
  const std::size_t in_face = last ? row - face_ - inner_ : row;
  return inner_ + (last == part.turned ? 0 : face_) + in_face;
}

// Values at the faces of the two parts of a merge, or of the only part of the ring, from
// those of the whole, in rows of `width` numbers.
void RingFactor::spread(const Part& part, const double* own, std::size_t width,
                        double* left, double* right) const {
  const std::size_t block = face_ * width;
  if (part.right < 0) {
    std::copy_n(own, block, left);
    std::copy_n(own, block, left + block);
    return;
  }
  std::copy_n(own, block, left);
  std::copy_n(own, block, right);
  std::copy_n(own + block, block, (part.turned ? right : left) + block);
  std::copy_n(own + 2 * block, block, (part.turned ? left : right) + block);
}

void RingFactor::solve(double* loads, std::size_t width) const {
  const std::size_t n = size_, block = face_ * kLanes;
  std::vector<std::size_t> begin(parts_.size() + 1, 0);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    begin[i + 1] = begin[i] + (parts_[i].matrix.pivots + parts_[i].matrix.rest) * kLanes;
  }
  std::vector<double> values(begin.back());
  // values of a part at its two faces
  const auto faces = [&](std::int64_t i) {
    return i < 0 ? nullptr : values.data() + begin[i] + parts_[i].matrix.pivots * kLanes;
  };
  for (std::size_t c = 0; c < width; c += kLanes) {
    const std::size_t count = std::min(kLanes, width - c);
    std::fill(values.begin(), values.end(), 0.0);
    for (const std::size_t i : order_) {
      const Part& part = parts_[i];
      double* own = values.data() + begin[i];
      if (i < sectors_) {
        const double* from = loads + i * n * width + c;
        for (std::size_t j = 0; j < n; ++j) {
          std::copy_n(from + j * width, count, own + place(part, j) * kLanes);
        }
      } else if (part.right >= 0) {
        const double *left = faces(part.left), *right = faces(part.right);
        add_to(own, left, block);
        add_to(own, right, block);
        add_to(own + block, (part.turned ? right : left) + block, block);
        add_to(own + 2 * block, (part.turned ? left : right) + block, block);
      } else {
        add_to(own, faces(part.left), block);
        add_to(own, faces(part.left) + block, block);
      }
      forward(part.matrix, own, kLanes);
    }
    for (std::size_t k = order_.size(); k-- > 0;) {
      const std::size_t i = order_[k];
      const Part& part = parts_[i];
      double* own = values.data() + begin[i];
      backward(part.matrix, own, kLanes);
      if (i >= sectors_) {
        spread(part, own, kLanes, faces(part.left), faces(part.right));
        continue;
      }
      double* to = loads + i * n * width + c;
      for (std::size_t j = 0; j < n; ++j) {
        std::copy_n(own + place(part, j) * kLanes, count, to + j * width);
      }
    }
  }
}

void RingFactor::reduce(const double* loads, std::size_t d, const std::int64_t* sector,
                        const double* rows, std::size_t k) {
  const std::size_t n = size_, f = face_, each = n * d;
  std::vector<char> stale(parts_.size(), 1);
  if (reduced_.holds(sector, rows, k, n, d * sectors_)) {
    for (std::size_t i = 0; i < parts_.size(); ++i) {
      stale[i] = changed_[i];
      if (i < sectors_) {
        const double* before = reduced_.loads.data() + i * each;
        stale[i] |= !std::equal(before, before + each, loads + i * each);
      }
    }
  } else {
    arrange(sector, rows, k, d);
  }
  reduced_.loads.assign(loads, loads + sectors_ * each);
  std::fill(changed_.begin(), changed_.end(), 0);
  const auto &order = reduced_.order, &begin = reduced_.begin;
  for (const std::size_t i : order_) {
    const Part& part = parts_[i];
    if (part.left >= 0) stale[i] |= stale[part.left];
    if (part.right >= 0) stale[i] |= stale[part.right];
    if (!stale[i]) continue;
    const std::size_t start = begin[part.first], count = width_of(part);
    const std::size_t width = padded(count);
    double* own = reduced_.values.get() + reduced_.at[i];
    std::fill(own, reduced_.values.get() + reduced_.at[i + 1], 0.0);
    if (i < sectors_) {
      const double* from = loads + i * each;
      for (std::size_t j = 0; j < n; ++j) {
        double* to = own + place(part, j) * width;
        for (std::size_t c = 0; c < d; ++c) to[c] = from[j * d + c];
      }
      for (std::size_t c = d; c < count; ++c) {
        const double* row = rows + order[start + c - d] * n;
        for (std::size_t j = 0; j < n; ++j) own[place(part, j) * width + c] = row[j];
      }
    } else {
      // loads of a child on its near face, and on the far one at a given row
      const auto take = [&](std::int64_t child, std::size_t far) {
        const Part& from = parts_[child];
        const std::size_t some = width_of(from), apart = padded(some);
        const std::size_t before = begin[from.first] - start;
        const double* faces =
            reduced_.values.get() + reduced_.at[child] + from.matrix.pivots * apart;
        for (std::size_t j = 0; j < 2 * f; ++j, faces += apart) {
          double* to = own + (j < f ? j : far + j - f) * width;
          add_to(to, faces, d);
          add_to(to + d + before, faces + d, some - d);
        }
      };
      if (part.right >= 0) {
        take(part.left, part.turned ? 2 * f : f);
        take(part.right, part.turned ? f : 2 * f);
      } else {
        take(part.left, 0);
      }
    }
    forward(part.matrix, own, width);
  }
}

// Order of loads by sector, and room for the values of all parts.
void RingFactor::arrange(const std::int64_t* sector, const double* rows, std::size_t k,
                         std::size_t d) {
  reduced_.d = d;
  reduced_.k = k;
  reduced_.sector.assign(sector, sector + k);
  reduced_.rows.assign(rows, rows + k * size_);
  reduced_.order.resize(k);
  std::iota(reduced_.order.begin(), reduced_.order.end(), 0);
  std::stable_sort(
      reduced_.order.begin(), reduced_.order.end(),
      [&](std::size_t a, std::size_t b) { return sector[a] < sector[b]; });
  reduced_.begin.assign(sectors_ + 1, 0);
  for (std::size_t i = 0; i < k; ++i) ++reduced_.begin[sector[i] + 1];
  std::partial_sum(reduced_.begin.begin(), reduced_.begin.end(), reduced_.begin.begin());
  reduced_.at.assign(1, 0);
  for (const Part& part : parts_) {
    const std::size_t size = part.matrix.pivots + part.matrix.rest;
    reduced_.at.push_back(reduced_.at.back() + size * padded(width_of(part)));
  }
  reduced_.values.reset(new double[reduced_.at.back()]);
}

void RingFactor::products(double* result) const {
  const std::size_t d = reduced_.d, total = d + reduced_.k;
  std::fill_n(result, total * total, 0.0);
  std::vector<double> sums(padded(total) * padded(total));
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const Part& part = parts_[i];
    const std::size_t count = width_of(part), width = padded(count);
    minus_products(reduced_.values.get() + reduced_.at[i], part.matrix.pivots, width,
                   sums.data());
    for (std::size_t a = 0; a < count; ++a) {
      double* row = result + number_of(part, a) * total;
      for (std::size_t b = a; b < count; ++b) {
        row[number_of(part, b)] -= sums[a * width + b];
      }
    }
  }
  // loads of different columns may come in any order
  for (std::size_t a = 0; a < total; ++a) {
    for (std::size_t b = a + 1; b < total; ++b) {
      double &upper = result[a * total + b], &lower = result[b * total + a];
      upper = lower = upper + lower;
    }
  }
}

void RingFactor::solve_reduced(const double* factors, double* solution) const {
  const std::size_t n = size_;
  std::vector<std::size_t> begin(parts_.size() + 1, 0);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    begin[i + 1] = begin[i] + parts_[i].matrix.pivots + parts_[i].matrix.rest;
  }
  std::vector<double> values(begin.back()), own_factors(reduced_.d + reduced_.k);
  const auto faces = [&](std::int64_t i) {
    return i < 0 ? nullptr : values.data() + begin[i] + parts_[i].matrix.pivots;
  };
  for (std::size_t k = order_.size(); k-- > 0;) {
    const std::size_t i = order_[k];
    const Part& part = parts_[i];
    const std::size_t count = width_of(part), width = padded(count);
    const double* row = reduced_.values.get() + reduced_.at[i];
    double* own = values.data() + begin[i];
    for (std::size_t c = 0; c < count; ++c) {
      own_factors[c] = factors[number_of(part, c)];
    }
    for (std::size_t p = 0; p < part.matrix.pivots; ++p, row += width) {
      double sum = 0.0;
      for (std::size_t c = 0; c < count; ++c) sum += own_factors[c] * row[c];
      own[p] = sum;
    }
    backward_one(part.matrix, own);
    if (i >= sectors_) {
      spread(part, own, 1, faces(part.left), faces(part.right));
      continue;
    }
    double* to = solution + i * n;
    for (std::size_t j = 0; j < n; ++j) to[j] = own[place(part, j)];
  }
}

// Number of columns of a part: the loads on all sectors, then those on its own ones.
std::size_t RingFactor::width_of(const Part& part) const {
  return reduced_.d + reduced_.begin[part.last] - reduced_.begin[part.first];
}

// Number of the load in a column of a part.
std::size_t RingFactor::number_of(const Part& part, std::size_t column) const {
  const std::size_t d = reduced_.d;
  if (column < d) return column;
  return d + reduced_.order[reduced_.begin[part.first] + column - d];
}

}  // namespace swgjoint
