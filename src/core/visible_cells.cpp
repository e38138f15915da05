#include "visible_cells.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace fleet2d {
namespace {

constexpr i64 FAR_OUT = i64{1} << 40;  // a bound that never binds: no column is so far out

// The whole square root of a number below 2**52.
i64 whole_root(i64 square) {
    auto root = static_cast<i64>(std::sqrt(static_cast<f64>(square)));
    while (root * root > square) --root;
    while ((root + 1) * (root + 1) <= square) ++root;
    return root;
}

// The first row, or column, whose centres are at a coordinate or beyond; and the last that is at it or before.
i64 first_from(i64 coordinate) { return -floor_div(CELL_CENTRE - coordinate, SUB); }
i64 last_up_to(i64 coordinate) { return floor_div(coordinate - CELL_CENTRE, SUB); }

// The whole part of a fraction whose numerator grows by the same amount from row to row.
struct Stepper {
    i64 column = 0;
    i64 rest = 1;  // of the numerator, below `size`
    i64 step = 0, extra = 0;
    i64 size = 2;

    static Stepper constant(i64 column) { return {.column = column}; }

    static Stepper of(i64 numerator, i64 growth, i64 size) {
        const i64 column = floor_div(numerator, size), step = floor_div(growth, size);
        return {column, numerator - column * size, step, growth - step * size, size};
    }

    void next_row() {
        column += step;
        rest += extra;
        if (rest >= size) {
            ++column;
            rest -= size;
        }
    }
};

Span empty_span(i64 row) { return {static_cast<i32>(row), 0, -1}; }

// The rows that a camera may see, and which columns of each.
struct VisibleRows {
    i64 first_row, last_row;
    View<i64> low, high;  // (all rows,) the first and the last column

    // Keep the columns within range.
    void limit_to_range(i64 x, i64 y, i64 far_squared, i64 columns) const {
        for (i64 row = first_row; row <= last_row; ++row) {
            const i64 dy = row * SUB + CELL_CENTRE - y;
            const i64 width = whole_root(far_squared - dy * dy);
            low[row] = std::max(i64{0}, first_from(x - width));
            high[row] = std::min(columns - 1, last_up_to(x + width));
        }
    }

    // Keep the columns whose centre (x + dx, y + dy) has (dx, dy) in a half plane.
    void limit_to(const HalfPlane& plane, i64 x, i64 y) const {
        i64 dy = first_row * SUB + CELL_CENTRE - y;
        if (plane.a == 0) {
            for (i64 row = first_row; row <= last_row; ++row, dy += SUB) {
                if (plane.b * dy < plane.bound) high[row] = low[row] - 1;
            }
            return;
        }
        // Of a c SUB >= bound, whose right side falls by b SUB from row to row.
        const i64 bound = (x - CELL_CENTRE) * plane.a + plane.bound - plane.b * dy;
        if (plane.a > 0) {
            const i64 size = SUB * plane.a;
            Stepper least = Stepper::of(bound + size - 1, -plane.b * SUB, size);  // rounded up
            for (i64 row = first_row; row <= last_row; ++row, least.next_row()) {
                low[row] = std::max(low[row], least.column);
            }
        } else {
            Stepper most = Stepper::of(-bound, plane.b * SUB, -SUB * plane.a);
            for (i64 row = first_row; row <= last_row; ++row, most.next_row()) {
                high[row] = std::min(high[row], most.column);
            }
        }
    }

    // Keep the rows that a point between two directions from (x, y), less than half a turn apart, may have; at most
    // two rows more than needed. A direction is a half plane's border, `to_right` and `to_left` of what is kept.
    void limit_rows(const HalfPlane& to_right, const HalfPlane& to_left, i64 y, i64 far) {
        const auto rise = [far](i64 sine) { return far * std::abs(sine) / UNIT + SUB; };
        const i64 sine_right = -to_right.a, sine_left = to_left.a;
        if (!(to_right.b >= 0 && to_left.b >= 0)) {  // it doesn't hold the direction of +y
            const i64 highest = std::max(sine_right, sine_left);
            last_row = std::min(last_row, last_up_to(y + (highest > 0 ? rise(highest) : SUB)));
        }
        if (!(to_right.b <= 0 && to_left.b <= 0)) {
            const i64 lowest = std::min(sine_right, sine_left);
            first_row = std::max(first_row, first_from(y - (lowest < 0 ? rise(lowest) : SUB)));
        }
    }

    // Leave out rows at the bottom and at the top that have no column.
    void trim() {
        while (first_row <= last_row && low[first_row] > high[first_row]) ++first_row;
        while (last_row > first_row && low[last_row] > high[last_row]) --last_row;
    }
};

// A piece of the visible region, seen from the eye.
struct VisiblePiece {
    Point right, left;  // vectors from the eye to the vertices on its borders
    Point wall;         // where its wall begins
    Point along;        // the vector along the wall
};

VisiblePiece opposite(const VisiblePiece& p) {
    return {{-p.right.x, -p.right.y}, {-p.left.x, -p.left.y}, {-p.wall.x, -p.wall.y}, {-p.along.x, -p.along.y}};
}

// A row that no cell of a piece is above, and at most one row more than needed. The highest point of a piece is
// the eye, or where a border meets the wall.
i64 highest_row(const VisiblePiece& piece, i64 eye_x, i64 eye_y, i64 centre) {
    const Point along = piece.along;
    const auto across = static_cast<f64>(along.x * (piece.wall.y - eye_y) - along.y * (piece.wall.x - eye_x));
    const auto height_at = [&](const Point& border) {
        return across / static_cast<f64>(along.x * border.y - along.y * border.x) * static_cast<f64>(border.y);
    };
    f64 top = 0;
    if (piece.right.y > 0) top = height_at(piece.right);
    if (piece.left.y > 0) top = std::max(top, height_at(piece.left));
    return floor_div(eye_y + static_cast<i64>(top) + 2 - centre, SUB);
}

// Writes the cells of pieces that lie in a window, and aren't too near, as spans. Pieces side by side have
// neighbouring cells in a row, so a span is kept open until one comes that isn't next to it.
class Filler {
public:
    // `open` has an empty span for each row, and has so again after `close`.
    Filler(i64 x, i64 y, i64 near_squared, const VisibleRows& window, std::vector<Span>& open, std::vector<Span>& spans)
        : x_(x),
          y_(y),
          near_squared_(near_squared),
          window_(window),
          open_(open),
          spans_(spans),
          eye_row_(last_up_to(y)) {
        at_row_ = floor_mod(y - CELL_CENTRE, SUB) == 0 && window.first_row <= eye_row_ && eye_row_ <= window.last_row;
    }

    // Write the open spans.
    void close() {
        for (i64 row = window_.first_row; row <= window_.last_row; ++row) {
            Span& open = open_[static_cast<std::size_t>(row)];
            if (open.first <= open.last) spans_.push_back(open);
            open = empty_span(row);
        }
    }

    // The cell of the eye belongs to no piece.
    void fill_eye() {
        if (!at_row_ || floor_mod(x_ - CELL_CENTRE, SUB) != 0) return;
        const i64 column = last_up_to(x_);
        if (window_.low[eye_row_] <= column && column <= window_.high[eye_row_]) add(eye_row_, column, column);
    }

    void fill(const VisiblePiece& piece) {
        if (piece.right.y > 0 || piece.left.y > 0) fill_above<1>(piece);
        if (piece.right.y < 0 || piece.left.y < 0) fill_above<-1>(opposite(piece));
        if (at_row_) {
            fill_row_of_eye<1>(piece);
            fill_row_of_eye<-1>(piece);
        }
    }

private:
    // Add the columns from first to last, without those too near.
    void add(i64 row, i64 first, i64 last) {
        const i64 dy = row * SUB + CELL_CENTRE - y_;
        if (dy * dy < near_squared_) {
            const i64 width = whole_root(near_squared_ - dy * dy - 1);
            const i64 hole_first = first_from(x_ - width), hole_last = last_up_to(x_ + width);
            if (hole_first <= hole_last && hole_first <= last && hole_last >= first) {
                if (first < hole_first) append(row, first, hole_first - 1);
                first = hole_last + 1;
            }
        }
        if (first <= last) append(row, first, last);
    }

    void append(i64 row, i64 first, i64 last) {
        Span& open = open_[static_cast<std::size_t>(row)];
        if (open.last + 1 == first) {
            open.last = static_cast<i32>(last);
        } else if (last + 1 == open.first) {
            open.first = static_cast<i32>(first);
        } else {
            if (open.first <= open.last) spans_.push_back(open);
            open = {static_cast<i32>(row), static_cast<i32>(first), static_cast<i32>(last)};
        }
    }

    // Add the same in coordinates that are turned by half a turn for sign -1; within the window.
    template <i64 sign>
    void add_turned(i64 turned_row, i64 first, i64 last) {
        const i64 row = sign * turned_row;
        if (sign < 0) {
            std::swap(first, last);
            first = -first, last = -last;
        }
        first = std::max(first, window_.low[row]);
        last = std::min(last, window_.high[row]);
        if (first <= last) add(row, first, last);
    }

    // Add the cells of a piece in the rows above the eye (sign 1), or below it (-1). Below, everything is turned
    // by half a turn about the origin, the piece too.
    template <i64 sign>
    void fill_above(const VisiblePiece& piece) {
        constexpr i64 centre = sign * CELL_CENTRE;
        const i64 eye_x = sign * x_, eye_y = sign * y_;
        const i64 lowest = sign > 0 ? window_.first_row : -window_.last_row;
        const i64 highest = sign > 0 ? window_.last_row : -window_.first_row;
        const i64 first_row = std::max(floor_div(eye_y - centre, SUB) + 1, lowest);
        const i64 last_row = std::min(highest, highest_row(piece, eye_x, eye_y, centre));
        if (first_row > last_row) return;
        const auto [rx, ry] = piece.right;
        const auto [lx, ly] = piece.left;
        const auto [ux, uy] = piece.along;
        i64 dy = first_row * SUB + centre - eye_y;
        // The right border: up to its column, less what is right on it and not before its corner.
        Stepper right =
            ry > 0 ? Stepper::of((eye_x - centre) * ry + dy * rx, SUB * rx, SUB * ry) : Stepper::constant(FAR_OUT);
        // The left border: beyond its column.
        Stepper left =
            ly > 0 ? Stepper::of((eye_x - centre) * ly + dy * lx, SUB * lx, SUB * ly) : Stepper::constant(-FAR_OUT);
        // The wall: up to its column for a wall to the right, beyond it for one to the left.
        const i64 height = first_row * SUB + centre - piece.wall.y;
        const i64 numerator = (piece.wall.x - centre) * uy + ux * height;
        Stepper wall = uy > 0   ? Stepper::of(numerator - 1, SUB * ux, SUB * uy)
                       : uy < 0 ? Stepper::of(-numerator, -SUB * ux, -SUB * uy)
                                : Stepper::constant(0);
        for (i64 row = first_row; row <= last_row; ++row, dy += SUB) {
            const bool on_right = right.rest == 0 && dy >= ry;
            i64 first = left.column + 1, last = right.column - static_cast<i64>(on_right);
            if (uy > 0) {
                last = std::min(last, wall.column);
            } else if (uy < 0) {
                first = std::max(first, wall.column + 1);
            } else if (ux * (row * SUB + centre - piece.wall.y) <= 0) {
                break;  // behind a wall along the rows
            }
            add_turned<sign>(row, first, last);
            right.next_row();
            left.next_row();
            wall.next_row();
        }
    }

    // Add the cells of a piece in the row through the eye, to the right of it (sign 1) or to the left (-1).
    template <i64 sign>
    void fill_row_of_eye(const VisiblePiece& piece) {
        if (!(sign * piece.right.y <= 0 && 0 < sign * piece.left.y)) return;
        // In turned coordinates, along +x.
        constexpr i64 centre = sign * CELL_CENTRE;
        const i64 first = floor_div(sign * x_ - centre, SUB) + 1;
        i64 last;
        if (piece.right.y == 0) {  // right along the border: visible up to its corner
            last = floor_div(sign * (x_ + piece.right.x) - centre - 1, SUB);
        } else {
            // uy (px - ax) < ux (y - ay), where the eye itself lies before the wall: uy > 0.
            const auto [ux, uy] = piece.along;
            const i64 bound = sign * (sign * piece.wall.x - centre) * uy + ux * (y_ - piece.wall.y);
            last = floor_div(bound - 1, SUB * sign * uy);
        }
        add_turned<sign>(sign * eye_row_, first, last);
    }

    i64 x_, y_, near_squared_;
    VisibleRows window_;
    std::vector<Span>& open_;
    std::vector<Span>& spans_;
    i64 eye_row_;
    bool at_row_;  // whether the eye is as high as the centres of its row, and the window has that row
};

// Whether a piece lies beside a half plane through the eye: its left border isn't part of it, the right one is.
bool is_beside(const VisiblePiece& piece, const HalfPlane& plane) {
    return plane.a * piece.right.x + plane.b * piece.right.y < 0 &&
           plane.a * piece.left.x + plane.b * piece.left.y <= 0;
}

}  // namespace

CellFinder::CellFinder(const Mesh& mesh, i64 rows, i64 columns)
    : mesh_(mesh),
      rows_(rows),
      columns_(columns),
      lookout_(mesh),
      low_(Array<i64>::empty({rows})),
      high_(Array<i64>::empty({rows})) {
    for (i64 row = 0; row < rows; ++row) open_.push_back(empty_span(row));
}

const std::vector<Span>& CellFinder::cells_in_view(Pose camera, const Reach& reach) {
    spans_.clear();
    const auto [x, y, heading] = camera;
    const Pieces pieces = lookout_.look_around(mesh_, x, y, locate(mesh_, x, y));
    if (pieces.count() == 0) return spans_;
    const i64 far = whole_root(reach.far_squared), half = reach.half_angle;
    const i64 bottom = std::max(i64{0}, first_from(y - far)), top = std::min(rows_ - 1, last_up_to(y + far));
    // An angle wider than half a turn is seen in two parts: right of the heading, and left of it.
    const i64 parts = 2 * QUARTER < half && half < TURN ? 2 : 1;
    for (i64 part = 0; part < parts; ++part) {
        VisibleRows window{bottom, top, low_, high_};
        HalfPlane from_right{0, 0}, to_left{0, 0};  // everything
        if (half < TURN) {
            from_right = left_of(part == 0 ? 2 * heading - half : 2 * heading);
            from_right.bound = part;  // the heading itself belongs to the first part
            const HalfPlane behind = left_of(part == parts - 1 ? 2 * heading + half : 2 * heading);
            to_left = {-behind.a, -behind.b};
            if (half > 0) window.limit_rows(from_right, to_left, y, far);
        }
        window.limit_to_range(x, y, reach.far_squared, columns_);
        if (half < TURN) {
            window.limit_to(from_right, x, y);
            window.limit_to(to_left, x, y);
        }
        window.trim();
        Filler filler(x, y, reach.near_squared, window, open_, spans_);
        filler.fill_eye();
        for (i64 i = 0; i < pieces.count(); ++i) {
            const WallLine wall = wall_line(mesh_, pieces.wall[i]);
            const VisiblePiece piece{towards_vertex(mesh_, pieces.right[i], x, y),
                                     towards_vertex(mesh_, pieces.left(i), x, y),
                                     wall.start,
                                     {wall.end.x - wall.start.x, wall.end.y - wall.start.y}};
            if (!is_beside(piece, from_right) && !is_beside(piece, to_left)) filler.fill(piece);
        }
        filler.close();
    }
    return spans_;
}

}  // namespace fleet2d
