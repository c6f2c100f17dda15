// Reading of the attributes of a map.
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <string_view>
#include <utility>
#include <vector>

#include "drive_map.h"
#include "lanes.h"

namespace swgjoint {

namespace {

// Sets an error message about an attribute, and returns false.
bool Fail(std::string* error, const char* attribute, const std::string& why) {
  *error = std::string("attribute '") + attribute + "' " + why;
  return false;
}

// Reads an attribute of `count` numbers, or of any number of them if `count` is 0.
bool Numbers(const char* text, const char* attribute, size_t count,
             std::vector<double>* out, std::string* error) {
  if (!ParseNumbers(text, out)) {
    return Fail(error, attribute, "is not a list of finite numbers");
  }
  if (count && out->size() != count) {
    return Fail(error, attribute,
                "has " + std::to_string(out->size()) + " numbers, needs " +
                    std::to_string(count));
  }
  return true;
}

// Six bits of every base64 digit, at each of four places in three bytes; other
// characters have a bit above them.
struct Digits {
  static constexpr uint32_t kOther = 1u << 31;
  uint32_t at[4][256];
  Digits() {
    constexpr char kAll[] =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (auto& place : at) std::fill(place, place + 256, kOther);
    for (uint32_t k = 0; k < 64; ++k) {
      const auto c = static_cast<unsigned char>(kAll[k]);
      // the first byte is the lowest one
      at[0][c] = k << 2;
      at[1][c] = k >> 4 | (k & 15) << 12;
      at[2][c] = (k >> 2) << 8 | (k & 3) << 22;
      at[3][c] = k << 16;
    }
  }
};

// Reads the bytes of numbers from base64. Returns false unless they are all of one or
// more finite numbers.
bool ParseBase64(const char* text, const char* end, std::vector<double>* out) {
  static const Digits digits;
  if ((end - text) % 4 || text == end) return false;
  const int padding = (end[-1] == '=') + (end[-1] == '=' && end[-2] == '=');
  const size_t bytes = (end - text) / 4 * 3 - padding;
  if (bytes % sizeof(double)) return false;
  out->resize(bytes / sizeof(double) + 1);  // every write has four bytes
  auto* to = reinterpret_cast<unsigned char*>(out->data());
  uint32_t seen = 0;
  for (; text < end; text += 4, to += 3) {
    uint32_t group = 0;
    for (int k = 0; k < 4; ++k) {
      const bool pads = end - text == 4 && k >= 4 - padding;
      group |= digits.at[k][static_cast<unsigned char>(pads ? 'A' : text[k])];
    }
    seen |= group;
    std::memcpy(to, &group, sizeof(group));
  }
  out->pop_back();
  return seen < Digits::kOther &&
         std::all_of(out->begin(), out->end(),
                     [](double x) { return std::isfinite(x); });
}

}  // namespace

bool ParseNumbers(const char* text, std::vector<double>* out) {
  out->clear();
  if (!text) return false;
  const char* end = text + std::strlen(text);
  const size_t mark = std::strlen(kBase64);
  if (!std::strncmp(text, kBase64, mark)) return ParseBase64(text + mark, end, out);
  while (true) {
    while (text < end && std::isspace(static_cast<unsigned char>(*text))) ++text;
    if (text == end) return !out->empty();
    double value;
    const auto result = std::from_chars(text, end, value);
    if (result.ec != std::errc() || !std::isfinite(value)) return false;
    text = result.ptr;
    if (text < end && !std::isspace(static_cast<unsigned char>(*text))) return false;
    out->push_back(value);
  }
}

// A map as it was read, and its texts, which end with zeros.
struct DriveMap::Origin {
  std::string texts;
  DriveMap map;
};

// The joints of an arm often have the same map, and an engine makes its data several
// times. A map with long texts, which takes long to read and has a large table, is
// therefore copied from one that has the same texts, and shares its table: from one in
// use, or from one of the last that were read.
bool DriveMap::Parse(const DriveText& text, std::string* error) {
  static std::mutex mutex;
  static std::vector<std::weak_ptr<const Origin>> known;
  static std::deque<std::shared_ptr<const Origin>> recent;
  static size_t kept = 0;  // length of their texts
  const char* const parts[] = {text.ratio,     text.orders,        text.knots,
                               text.potential, text.end_stiffness, text.kinematic_error};
  std::vector<std::string_view> owns;  // with the zeros at their ends
  size_t size = 0;
  for (const char* part : parts) {
    if (!part) continue;
    owns.emplace_back(part, std::strlen(part) + 1);
    size += owns.back().size();
  }
  if (size > kLongTexts) {
    std::vector<std::shared_ptr<const Origin>> used;
    {
      const std::lock_guard<std::mutex> lock(mutex);
      known.erase(std::remove_if(known.begin(), known.end(),
                                 [](const auto& one) { return one.expired(); }),
                  known.end());
      for (const auto& one : known) used.push_back(one.lock());
    }
    for (const auto& one : used) {
      if (!one || one->texts.size() != size) continue;
      std::string_view rest = one->texts;
      bool equal = true;
      for (const std::string_view own : owns) {
        equal = equal && rest.substr(0, own.size()) == own;
        rest.remove_prefix(std::min(own.size(), rest.size()));
      }
      if (!equal) continue;
      *this = one->map;
      origin_ = one;
      return true;
    }
  }
  if (!Read(text, error)) return false;
  if (size <= kLongTexts) return true;
  auto origin = std::make_shared<Origin>();
  origin->texts.reserve(size);
  for (const std::string_view own : owns) origin->texts.append(own);
  origin->map = *this;
  origin_ = origin;
  const std::lock_guard<std::mutex> lock(mutex);
  known.push_back(origin);
  recent.push_back(origin);
  for (kept += size; kept > kKeptTexts; recent.pop_front()) {
    kept -= recent.front()->texts.size();
  }
  return true;
}

bool DriveMap::Read(const DriveText& text, std::string* error) {
  std::vector<double> list, orders;
  if (!Numbers(text.ratio, "ratio", 1, &list, error)) return false;
  ratio_ = list[0];
  if (ratio_ == 0) return Fail(error, "ratio", "is 0");
  inverse_ratio_ = 1 / ratio_;

  // orders in (theta, psi), with the mean (0, 0) first
  if (!Numbers(text.orders, "orders", 0, &orders, error)) return false;
  if (orders.size() % 2) return Fail(error, "orders", "does not hold pairs");
  n_ = static_cast<int>(orders.size() / 2);
  for (int k = 0; k < n_; ++k) {
    const double theta = orders[2 * k], psi = orders[2 * k + 1];
    if (theta != std::rint(theta) || psi != std::rint(psi) || std::fabs(theta) > 1e6 ||
        std::fabs(psi) > 1e6) {
      return Fail(error, "orders", "holds a number that is no integer below 1e6");
    }
    moves_psi_ |= psi != 0;
    top_order_ = std::max(top_order_, std::fabs(theta + psi / ratio_));
    top_theta_ = std::max(top_theta_, std::fabs(theta));
    top_psi_ = std::max(top_psi_, std::fabs(psi));
  }
  if (orders[0] != 0 || orders[1] != 0) {
    return Fail(error, "orders", "does not begin with the mean (0 0)");
  }

  if (!Numbers(text.knots, "knots", 0, &knots_, error)) return false;
  const int m = static_cast<int>(knots_.size()) - 1;
  if (m < 1) return Fail(error, "knots", "has fewer than two numbers");
  for (int j = 0; j < m; ++j) {
    if (knots_[j + 1] <= knots_[j]) return Fail(error, "knots", "does not increase");
  }
  const size_t n = n_;
  std::vector<double> potential, end;
  if (!Numbers(text.potential, "potential", n * 2 * m * 5, &potential, error) ||
      !Numbers(text.end_stiffness, "end_stiffness", n * 4, &end, error) ||
      !Numbers(text.kinematic_error, "kinematic_error", n * 2, &list, error)) {
    return false;
  }
  size_.lanes = n_ - 1 > kMany ? kWideLanes : kLanes;
  const int lanes = size_.lanes;
  blocks_ = (n_ - 1 + lanes - 1) / lanes;
  weight_.assign(static_cast<size_t>(blocks_) * size_.weights(), 0.0);
  harmonics_.assign(static_cast<size_t>(blocks_) * size_.harmonics(), 0.0);
  for (int k = 1; k < n_; ++k) {
    double* to = &harmonics_[static_cast<size_t>((k - 1) / lanes) * size_.harmonics()];
    to += (k - 1) % lanes;
    to[0] = orders[2 * k];
    to[lanes] = orders[2 * k + 1];
    to[2 * lanes] = list[2 * k];
    to[3 * lanes] = list[2 * k + 1];
  }
  error_mean_ = list[0];
  if (many()) local_.Set(&orders[2], &list[2], n_ - 1, m + 2);

  // one table for the intervals and for the parabolas beyond the first and last knot
  segments_ = m + 2;
  base_.resize(segments_);
  low_.assign(segments_, -std::numeric_limits<double>::infinity());
  high_.assign(segments_, std::numeric_limits<double>::infinity());
  mean_.assign(static_cast<size_t>(segments_) * size_.mean(), 0.0);
  auto table = std::make_shared<LaneVector>(
      static_cast<size_t>(segments_) * blocks_ * size_.block(), 0.0);
  table_ = table;
  for (int seg = 0; seg < segments_; ++seg) {
    base_[seg] = knots_[std::clamp(seg - 1, 0, m)];
    if (seg > 0) low_[seg] = knots_[seg - 1];
    if (seg <= m) high_[seg] = knots_[seg];
  }
  // coefficients of A (ab = 0) or B of a harmonic in a segment
  const auto read = [&](int k, int ab, int seg, double to[5]) {
    const int j = std::clamp(seg - 1, 0, m - 1);
    const double* from = &potential[((2 * k + ab) * static_cast<size_t>(m) + j) * 5];
    if (seg >= 1 && seg <= m) {
      std::copy(from, from + 5, to);
    } else {
      const double d = seg == 0 ? 0.0 : knots_[m] - knots_[m - 1];
      to[0] = Value(from, d);
      to[1] = Slope(from, d);
      to[2] = 0.5 * end[4 * k + 2 * ab + (seg == 0 ? 0 : 1)];
      to[3] = to[4] = 0;
    }
  };
  for (int seg = 0; seg < segments_; ++seg) {
    double to[5], *mean = &mean_[static_cast<size_t>(seg) * size_.mean()];
    read(0, 0, seg, to);
    for (int p = 0; p < 5; ++p) mean[p * lanes] = to[p];
  }
  // block by block, because the harmonics of one fit in the fastest cache
  for (int block = 0; block < blocks_; ++block) {
    const int first = 1 + block * lanes, count = std::min(lanes, n_ - first);
    for (int seg = 0; seg < segments_; ++seg) {
      const size_t place = static_cast<size_t>(seg) * blocks_ + block;
      double to[5], *row = &(*table)[place * size_.block()];
      for (int lane = 0; lane < count; ++lane) {
        for (int ab = 0; ab < 2; ++ab) {
          read(first + lane, ab, seg, to);
          for (int p = 0; p < 5; ++p) row[(2 * p + ab) * lanes + lane] = to[p];
        }
      }
    }
  }

  FindRecipes(orders);
  return true;
}

// Finds blocks whose orders are those of an earlier block plus those of an earlier
// harmonic. A map of finite elements has all multiples of one order, so that only its
// first blocks need a series. Zeros that pad the last block do not count.
void DriveMap::FindRecipes(const std::vector<double>& orders) {
  const int count = n_ - 1;
  const double* n = orders.data() + 2;  // without the mean
  const int lanes = size_.lanes, harmonics = size_.harmonics();
  const auto place = [=](int k) { return k / lanes * harmonics + k % lanes; };
  std::map<std::pair<double, double>, int> earlier;  // first harmonic of every order
  recipe_.assign(blocks_, Recipe());
  std::vector<int> depth(blocks_, 0);  // number of rotations one after the other
  int few = 0;                         // as many as multiples of one order need
  for (int k = lanes; k < count; k += lanes) {
    const int block = k / lanes;
    for (int b = k - lanes; b < k; ++b) {
      earlier.emplace(std::pair(n[2 * b], n[2 * b + 1]), b);
    }
    if (block >> few) ++few;
    for (int a = 0; a < k && !(recipe_[block].from >= 0 && depth[block] <= few);
         a += lanes) {
      const double theta = n[2 * k] - n[2 * a], psi = n[2 * k + 1] - n[2 * a + 1];
      const auto found = earlier.find({theta, psi});
      if (found == earlier.end()) continue;
      const int shift = found->second;
      const int need = 1 + std::max(depth[a / lanes], depth[shift / lanes]);
      bool shifted = recipe_[block].from < 0 || need < depth[block];
      for (int b = 1; b < std::min(lanes, count - k); ++b) {
        shifted = shifted && n[2 * (k + b)] - n[2 * (a + b)] == theta &&
                  n[2 * (k + b) + 1] - n[2 * (a + b) + 1] == psi;
      }
      if (!shifted) continue;
      recipe_[block] = {place(a), place(shift)};
      depth[block] = need;
    }
  }
}

}  // namespace swgjoint
