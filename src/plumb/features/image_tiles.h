// Overlapping tiles of a large image, and the segments of the tiles put together.
#pragma once

#include <cstddef>
#include <vector>

#include "plumb/features/image_view.h"
#include "plumb/geometry/segment.h"

namespace plumb {

/// Columns and rows of tiles; 1 x 1: the image as a whole, 0 x 0: as many as it needs.
struct TileGrid {
  int columns = 1, rows = 1;
};

/// A tile's place in the image [px].
struct ImageTile {
  int left = 0, top = 0, width = 0, height = 0;
};

/// The grid for which a tile is at most 2.5 times as wide and high as the network's input.
TileGrid ChooseTileGrid(int image_width_px, int image_height_px, int input_width_px,
                        int input_height_px);

/// Tiles of equal size, row by row; neighbours share an eighth of a tile or a little more. Places
/// are even, as subsampled chroma needs. Fewer than asked for where the image has no room.
std::vector<ImageTile> LayOutTiles(int image_width_px, int image_height_px, const TileGrid& grid);

/// The part of a valid image; borrows the same planes.
ImageView ViewOfTile(const ImageView& image, const ImageTile& tile);

/// Puts together what was found in each tile. Where two tiles see the same area they see the same
/// lines: two segments that cross it side by side are parts of one line, which gets their outermost
/// ends and the better score. So a line over a seam is one segment, and none comes twice.
///
/// @param tiles     Of LayOutTiles().
/// @param segments  [px of the tile] of each tile; any order.
/// @param reach_px  How far apart two detections of a line may be.
/// @return segments [px of the image], best score first, ties by tile and order in it.
std::vector<Segment2> MergeTileSegments(const std::vector<ImageTile>& tiles,
                                        const std::vector<std::vector<Segment2>>& segments,
                                        double reach_px);

}  // namespace plumb
