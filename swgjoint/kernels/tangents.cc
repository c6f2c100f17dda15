#include "tangents.h"

#include <algorithm>
#include <vector>

#include "dense_factors.h"
#include "eight_lanes.h"
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

void add_blocks(const double* blocks, std::size_t count, std::size_t size,
                const std::int64_t* into, double* result, std::size_t full) {
  for (std::size_t s = 0; s < count; ++s, result += full * full) {
    for (std::size_t i = 0; i < size; ++i, blocks += size) {
      double* row = result + full * into[i];
      for (std::size_t k = 0; k < size; ++k) row[into[k]] += blocks[k];
    }
  }
}

SWGJOINT_WIDE void respond(const std::int64_t* offsets, const double* blocks,
                           std::size_t count, std::size_t rows, std::size_t size,
                           const double* force, std::size_t teeth, double* result) {
  // most teeth carry no load, and one flank of the others does: up to kLanes teeth whose
  // loads begin at similar entries
  struct Loaded {
    std::size_t tooth, begin, end;
  };
  std::vector<Loaded> loads;
  for (std::size_t tooth = 0; tooth < teeth; ++tooth) {
    const double* own = force + size * tooth;
    std::size_t begin = 0, end = size;
    while (begin < size && own[begin] == 0.0) ++begin;
    while (end > begin && own[end - 1] == 0.0) --end;
    if (begin < end) loads.push_back({tooth, begin, end});
  }
  std::stable_sort(loads.begin(), loads.end(), [](const Loaded& a, const Loaded& b) {
    return a.begin < b.begin;
  });
  std::vector<double> together(size * kLanes);
  for (std::size_t first = 0; first < loads.size(); first += kLanes) {
    const std::size_t lanes = std::min(kLanes, loads.size() - first);
    const Loaded* group = loads.data() + first;
    std::size_t end = 0;
    for (std::size_t l = 0; l < lanes; ++l) end = std::max(end, group[l].end);
    std::fill(together.begin(), together.end(), 0.0);
    for (std::size_t l = 0; l < lanes; ++l) {
      const double* own = force + size * group[l].tooth;
      for (std::size_t c = 0; c < size; ++c) together[c * kLanes + l] = own[c];
    }
    for (std::size_t k = 0; k < count; ++k) {
      const auto all = static_cast<std::int64_t>(teeth);
      const std::size_t after = static_cast<std::size_t>((offsets[k] % all + all) % all);
      const double* block = blocks + rows * size * k;
      double* moved[kLanes];
      for (std::size_t l = 0; l < lanes; ++l) {
        moved[l] = result + rows * ((group[l].tooth + after) % teeth);
      }
      by_blocks(rows, [&](std::size_t row, auto some) SWGJOINT_INLINED {
        Lanes sum[some];
        for (std::size_t r = 0; r < some; ++r) sum[r] = Lanes{};
        for (std::size_t c = group->begin; c < end; ++c) {
          const Lanes push = lanes_at(&together[c * kLanes]);
          const double* column = block + row * size + c;
          for (std::size_t r = 0; r < some; ++r) sum[r] += column[r * size] * push;
        }
        double sums[some][kLanes];
        std::memcpy(sums, sum, sizeof sums);
        for (std::size_t l = 0; l < lanes; ++l) {
          for (std::size_t r = 0; r < some; ++r) moved[l][row + r] += sums[r][l];
        }
      });
    }
  }
}

SWGJOINT_WIDE void contact_compliance(const std::int64_t* block_of, std::size_t teeth,
                        const std::int64_t* after, const double* blocks, std::size_t size,
                        const std::int64_t* tooth, const double* weight, std::size_t n,
                        double* result) {
  // runs of points on one tooth; a point moves one flank of its tooth, half of the
  // entries: range of those that the points of a run move
  struct Run {
    std::int64_t tooth;
    std::size_t from, to, begin, end;
    std::ptrdiff_t other;  // another run on the same tooth; -1 for none
  };
  std::vector<Run> runs;
  std::vector<std::ptrdiff_t> run_of(teeth, -1);
  const auto count = static_cast<std::int64_t>(teeth);
  for (std::size_t j = 0; j < n; ++j) {
    if (!j || tooth[j] != tooth[j - 1]) {
      std::ptrdiff_t& last = run_of[static_cast<std::size_t>((tooth[j] % count + count) % count)];
      runs.push_back({tooth[j], j, j, size, 0, last});
      last = static_cast<std::ptrdiff_t>(runs.size()) - 1;
    }
    Run& run = runs.back();
    run.to = j + 1;
    const double* own = weight + size * j;
    for (std::size_t b = 0; b < size; ++b) {
      if (own[b] == 0.0) continue;
      run.begin = std::min(run.begin, b);
      run.end = std::max(run.end, b + 1);
    }
  }
  // all pairs at one offset together, because a block is larger than the fast memory
  std::vector<double> moved, parts;
  std::vector<const double*> rows_of;
  for (std::int64_t apart = 0; apart <= count / 2; ++apart) {
    // points the other way around have the same compliance
    const bool both_ways = apart > 0 && 2 * apart != count;
    for (const Run& run : runs) {
      const std::int64_t at = ((run.tooth + apart) % count + count) % count;
      for (std::ptrdiff_t r = run_of[static_cast<std::size_t>(at)]; r >= 0;
           r = runs[static_cast<std::size_t>(r)].other) {
        const Run& responds = runs[static_cast<std::size_t>(r)];
        for (std::size_t i = responds.from; i < responds.to; ++i) {
          const double* own = weight + size * i;
          rows_of.clear();
          parts.clear();
          for (std::int64_t k = block_of[apart]; k >= 0; k = after[k]) {
            const double* rows = blocks + size * size * static_cast<std::size_t>(k);
            for (std::size_t a = 0; a < size; ++a) {
              if (own[a] == 0.0) continue;
              rows_of.push_back(rows + size * a + run.begin);
              parts.push_back(own[a]);
            }
          }
          const std::size_t width = std::max(run.end, run.begin) - run.begin;
          moved.assign(width, 0.0);
          add_columns(moved.data(), rows_of.data(), parts.data(), parts.size(), width);
          for (std::size_t j = run.from; j < run.to; ++j) {
            const double* other = weight + size * j + run.begin;
            const double sum = sum_of_products(moved.data(), other, width);
            result[n * i + j] = sum;
            if (both_ways) result[n * j + i] = sum;
          }
        }
      }
    }
  }
}

}  // namespace swgjoint
