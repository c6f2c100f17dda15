#include "tangents.h"

#include <algorithm>
#include <vector>

#include "wide.h"

namespace swgjoint {

void add_station_stiffness(const double* weights, std::size_t p, std::size_t width,
                           const double* direction, const double* stiffness,
                           std::size_t count, std::size_t intervals, double* result) {
  const std::size_t size = width + 2 * (intervals - 1);
  std::vector<double> row(width);
  for (std::size_t s = 0; s < count; ++s, result += size * size) {
    for (std::size_t k = 0; k < intervals; ++k) {
      double* corner = result + 2 * k * (size + 1);
      for (std::size_t i = 0; i < p; ++i, direction += 2, ++stiffness) {
        // most stations do not touch
        if (*stiffness == 0.0) continue;
        const double *x = weights + 2 * width * i, *y = x + width;
        for (std::size_t m = 0; m < width; ++m) {
          row[m] = direction[0] * x[m] + direction[1] * y[m];
        }
        for (std::size_t m = 0; m < width; ++m) {
          const double force = *stiffness * row[m];
          double* line = corner + m * size;
          for (std::size_t l = 0; l < width; ++l) line[l] += force * row[l];
        }
      }
    }
  }
}

SWGJOINT_WIDE void respond(const std::int64_t* offsets, const double* blocks,
                           std::size_t count, std::size_t rows, std::size_t size,
                           const double* force, std::size_t teeth, double* result) {
  // most teeth carry no load, and one flank of the others does
  struct Loaded {
    std::int64_t tooth;
    const double* force;
    std::size_t begin, end;
    double* moved;
  };
  std::vector<Loaded> loads;
  const auto all = static_cast<std::int64_t>(teeth);
  for (std::int64_t tooth = 0; tooth < all; ++tooth, force += size) {
    std::size_t begin = 0, end = size;
    while (begin < size && force[begin] == 0.0) ++begin;
    while (end > begin && force[end - 1] == 0.0) --end;
    if (begin < end) loads.push_back({tooth, force, begin, end, nullptr});
  }
  for (std::size_t k = 0; k < count; ++k) {
    for (Loaded& load : loads) {
      const std::int64_t at = ((load.tooth + offsets[k]) % all + all) % all;
      load.moved = result + rows * static_cast<std::size_t>(at);
    }
    for (std::size_t r = 0; r < rows; ++r, blocks += size) {
      for (const Loaded& load : loads) {
        const std::size_t b = load.begin;
        load.moved[r] += sum_of_products(blocks + b, load.force + b, load.end - b);
      }
    }
  }
}

SWGJOINT_WIDE void contact_compliance(const std::int64_t* block_of, std::size_t teeth,
                        const std::int64_t* after, const double* blocks, std::size_t size,
                        const std::int64_t* tooth, const double* weight, std::size_t n,
                        double* result) {
  std::vector<double> moved(size);
  // a point moves one flank of its tooth, half of the entries: range of those that the
  // points from j on with the tooth of j move
  std::vector<std::size_t> begin(n, size), end(n, 0);
  for (std::size_t j = n; j-- > 0;) {
    const double* own = weight + size * j;
    for (std::size_t b = 0; b < size; ++b) {
      if (own[b] == 0.0) continue;
      begin[j] = std::min(begin[j], b);
      end[j] = b + 1;
    }
    if (j + 1 < n && tooth[j + 1] == tooth[j]) {
      begin[j] = std::min(begin[j], begin[j + 1]);
      end[j] = std::max(end[j], end[j + 1]);
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    const double* own = weight + size * i;
    for (std::size_t j = 0; j < n; ++j) {
      // points of one tooth follow one another: keep what moves it
      const bool again = j > 0 && tooth[j] == tooth[j - 1];
      const auto count = static_cast<std::int64_t>(teeth);
      const std::int64_t apart = ((tooth[i] - tooth[j]) % count + count) % count;
      if (!again) {
        moved.assign(size, 0.0);
        for (std::int64_t k = block_of[apart]; k >= 0; k = after[k]) {
          const double* rows = blocks + size * size * static_cast<std::size_t>(k);
          for (std::size_t a = 0; a < size; ++a) {
            if (own[a] == 0.0) continue;
            const double* row = rows + size * a;
            for (std::size_t b = begin[j]; b < end[j]; ++b) moved[b] += own[a] * row[b];
          }
        }
      }
      const double* other = weight + size * j;
      double sum = 0.0;
      for (std::size_t b = begin[j]; b < end[j]; ++b) sum += moved[b] * other[b];
      result[n * i + j] = sum;
    }
  }
}

}  // namespace swgjoint
