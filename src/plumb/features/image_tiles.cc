#include "plumb/features/image_tiles.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "plumb/features/clip_segment.h"

namespace plumb {
namespace {

constexpr double kOverlap = 0.125;     // of a tile, shared with the next one
constexpr double kMaxTileScale = 2.5;  // tile over network input
constexpr int kMinTilePx = 64;
constexpr double kMinSharedLength = 0.5;  // of the shorter part in the area that both tiles see

/// Begin and common length of equal parts of `size` px.
struct Axis {
  int length = 0;
  std::vector<int> begins;
};

Axis Divide(int size, int count) {
  count = std::clamp(count, 1, std::max(size / kMinTilePx, 1));
  int length = size;
  if (count > 1) {
    length = static_cast<int>(std::ceil(size / (count - (count - 1) * kOverlap)));
    // The last tile begins at size - length, which must be even.
    length = std::min(length + (size - length) % 2, size);
  }
  Axis axis{length, {}};
  for (int i = 0; i < count; ++i) {
    const int begin = count > 1 ? (size - length) * i / (count - 1) : 0;
    axis.begins.push_back(begin - begin % 2);
  }
  return axis;
}

int PartsFor(int size, int input) {
  const double part = kMaxTileScale * input;
  if (input <= 0 || size <= part) return 1;
  return static_cast<int>(std::ceil((size / part - kOverlap) / (1.0 - kOverlap)));
}

/// The area that two tiles see; empty where width or height is not positive.
ImageTile Intersect(const ImageTile& a, const ImageTile& b) {
  const int left = std::max(a.left, b.left), top = std::max(a.top, b.top);
  return {left, top, std::min(a.left + a.width, b.left + b.width) - left,
          std::min(a.top + a.height, b.top + b.height) - top};
}

/// The part of `segment` inside `area`. @return false if there is none.
bool ClipToArea(const ImageTile& area, Segment2* segment) {
  const Eigen::Vector2d corner(area.left, area.top);
  segment->start -= corner;
  segment->end -= corner;
  if (!ClipToImage(area.width, area.height, segment)) return false;
  segment->start += corner;
  segment->end += corner;
  return true;
}

constexpr double kApart = std::numeric_limits<double>::infinity();

/// How far apart the parts `a` and `b` of two segments in the area that their tiles share are
/// [px]; kApart if they do not lie side by side.
double DistanceBetween(const Segment2& a, const Segment2& b) {
  const Segment2& longer = a.Length() >= b.Length() ? a : b;
  const Segment2& shorter = a.Length() >= b.Length() ? b : a;
  const double length = longer.Length();
  const Eigen::Vector2d along = longer.Delta() / length;
  double positions[2], distances[2];
  for (int i = 0; i < 2; ++i) {
    const Eigen::Vector2d relative = (i == 0 ? shorter.start : shorter.end) - longer.start;
    positions[i] = along.dot(relative);
    distances[i] = std::abs(along.x() * relative.y() - along.y() * relative.x());
  }
  const double shared = std::min(std::max(positions[0], positions[1]), length) -
                        std::max(std::min(positions[0], positions[1]), 0.0);
  return shared >= kMinSharedLength * shorter.Length() ? std::max(distances[0], distances[1])
                                                       : kApart;
}

/// Sets of pieces that are one line; the root is the piece of lowest index.
class Groups {
 public:
  explicit Groups(size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0u); }
  size_t RootOf(size_t i) const {
    while (parent_[i] != i) i = parent_[i];
    return i;
  }
  void Join(size_t a, size_t b) {
    const size_t root_a = RootOf(a), root_b = RootOf(b);
    parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
  }

 private:
  std::vector<size_t> parent_;
};

/// The part of piece `index` in the area that two tiles see.
struct Part {
  size_t index = 0;
  Segment2 segment;
};

void CutToArea(const ImageTile& area, const std::vector<Segment2>& pieces, size_t begin, size_t end,
               std::vector<Part>* out_parts) {
  out_parts->clear();
  for (size_t i = begin; i < end; ++i) {
    Segment2 part = pieces[i];
    if (ClipToArea(area, &part)) out_parts->push_back({i, part});
  }
}

/// Joins each of `parts` with the nearest of `others` within reach: of parallel lines the right
/// one.
void JoinNearest(const std::vector<Part>& parts, const std::vector<Part>& others, double reach_px,
                 Groups* groups) {
  for (const Part& part : parts) {
    double least = kApart;
    size_t nearest = 0;
    for (const Part& other : others) {
      const double distance = DistanceBetween(part.segment, other.segment);
      if (distance < least) {
        least = distance;
        nearest = other.index;
      }
    }
    if (least <= reach_px) groups->Join(part.index, nearest);
  }
}

/// `whole` made longer so that it spans `part`, too; the direction is the longer one's.
void Extend(const Segment2& part, Segment2* whole) {
  const Eigen::Vector2d ends[] = {whole->start, whole->end, part.start, part.end};
  const Eigen::Vector2d along = part.Length() > whole->Length() ? part.Delta() : whole->Delta();
  const auto before = [&](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return along.dot(a) < along.dot(b);
  };
  const auto [first, last] = std::minmax_element(std::begin(ends), std::end(ends), before);
  whole->start = *first;
  whole->end = *last;
  whole->score = std::max(whole->score, part.score);
}

}  // namespace

TileGrid ChooseTileGrid(int image_width_px, int image_height_px, int input_width_px,
                        int input_height_px) {
  return {PartsFor(image_width_px, input_width_px), PartsFor(image_height_px, input_height_px)};
}

std::vector<ImageTile> LayOutTiles(int image_width_px, int image_height_px, const TileGrid& grid) {
  const Axis x = Divide(image_width_px, grid.columns), y = Divide(image_height_px, grid.rows);
  std::vector<ImageTile> tiles;
  for (const int top : y.begins) {
    for (const int left : x.begins) tiles.push_back({left, top, x.length, y.length});
  }
  return tiles;
}

ImageView ViewOfTile(const ImageView& image, const ImageTile& tile) {
  ImageView view = image;
  view.width_px = tile.width;
  view.height_px = tile.height;
  for (size_t i = 0; i < static_cast<size_t>(NumPlanes(image.format)); ++i) {
    view.planes[i].data += NumRows(image.format, i, tile.top) * image.planes[i].row_stride_bytes +
                           RowBytes(image.format, i, tile.left);
  }
  return view;
}

std::vector<Segment2> MergeTileSegments(const std::vector<ImageTile>& tiles,
                                        const std::vector<std::vector<Segment2>>& segments,
                                        double reach_px) {
  std::vector<Segment2> pieces;  // [px of the image], tile after tile
  std::vector<size_t> first_of(tiles.size() + 1, 0);
  for (size_t t = 0; t < tiles.size(); ++t) {
    const Eigen::Vector2d corner(tiles[t].left, tiles[t].top);
    for (const Segment2& segment : segments[t]) {
      pieces.push_back({segment.start + corner, segment.end + corner, segment.score});
    }
    first_of[t + 1] = pieces.size();
  }
  Groups groups(pieces.size());
  std::vector<Part> ours, theirs;  // of the two tiles, in the area that both see
  for (size_t a = 0; a < tiles.size(); ++a) {
    for (size_t b = a + 1; b < tiles.size(); ++b) {
      const ImageTile area = Intersect(tiles[a], tiles[b]);
      if (area.width <= 0 || area.height <= 0) continue;
      CutToArea(area, pieces, first_of[a], first_of[a + 1], &ours);
      CutToArea(area, pieces, first_of[b], first_of[b + 1], &theirs);
      JoinNearest(ours, theirs, reach_px, &groups);
      JoinNearest(theirs, ours, reach_px, &groups);
    }
  }
  std::vector<Segment2> merged(pieces.size());
  std::vector<size_t> roots;
  for (size_t i = 0; i < pieces.size(); ++i) {
    const size_t root = groups.RootOf(i);
    if (root == i) {
      merged[i] = pieces[i];
      roots.push_back(i);
    } else {
      Extend(pieces[i], &merged[root]);
    }
  }
  std::vector<Segment2> result;
  for (const size_t root : roots) result.push_back(merged[root]);
  std::stable_sort(result.begin(), result.end(),
                   [](const Segment2& a, const Segment2& b) { return a.score > b.score; });
  return result;
}

}  // namespace plumb
