/** What of the plan stands still: floors, furniture, doors, walls. Drawn once for each size. */

import { type DoorwayFacts, LOOK, type ObjectFacts } from "../contract";
import type { Home } from "../data/home";
import type { Colors } from "../theme";
import { drawFloors } from "./floors";
import type { Frame } from "./frame";
import { drawPiece } from "./furniture";
import { Pen } from "./pen";

export const WALL_M = LOOK.walls.thickness;
/** How far the tops of walls are drawn above the floor, as if one looked at the home a little from the south [m]. */
export const LIFT_M = LOOK.walls.lift;
const { top: WALL_TOP, face: WALL_FACE, edge: WALL_EDGE, shadow: WALL_SHADOW } = LOOK.walls;

type Context = CanvasRenderingContext2D;

export function tracePolygons(context: Context, frame: Frame, polygons: readonly (readonly (readonly [number, number])[])[]): void {
  context.beginPath();
  for (const ring of polygons) {
    ring.forEach(([x, y], i) => {
      if (i === 0) context.moveTo(frame.x(x), frame.y(y));
      else context.lineTo(frame.x(x), frame.y(y));
    });
    context.closePath();
  }
}

/** The free space of a home, and all that its outer walls enclose, as paths in metres. */
class Outlines {
  readonly free = new Path2D();
  readonly outer = new Path2D();

  constructor(home: Home) {
    for (const rings of home.facts.free) {
      rings.forEach((ring, i) => {
        const path = new Path2D();
        ring.forEach(([x, y], k) => (k === 0 ? path.moveTo(x, y) : path.lineTo(x, y)));
        path.closePath();
        this.free.addPath(path);
        if (i === 0) this.outer.addPath(path);
      });
    }
  }

  /** Fill the home with its outer walls. */
  fillHull(context: Context): void {
    context.lineWidth = 2 * WALL_M;
    context.lineJoin = "miter";
    context.miterLimit = 3;
    context.stroke(this.outer);
    context.fill(this.outer);
  }
}

/** Draw a home at the size of a canvas, whose pixels are `ratio` times as many as those of the screen. */
export function drawGround(canvas: HTMLCanvasElement, home: Home, frame: Frame, ratio: number, colors: Colors, objects: readonly ObjectFacts[]): void {
  const context = canvas.getContext("2d")!;
  const scale = frame.scale * ratio;
  const outlines = new Outlines(home);
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  frame.enter(context, ratio);
  context.save();
  context.shadowColor = colors.shadow;
  context.shadowBlur = 1.1 * scale;
  context.shadowOffsetX = 0.15 * scale;
  context.shadowOffsetY = 0.4 * scale;
  context.fillStyle = WALL_FACE;
  context.strokeStyle = WALL_FACE;
  outlines.fillHull(context);
  context.restore();
  context.save();
  context.clip(outlines.free, "evenodd");
  drawFloors(context, home);
  objects.forEach((thing) => drawPiece(context, thing, home.facts.symbols, scale));
  context.restore();
  const pen = new Pen(context);
  const movable = new Set(home.facts.doors.map((door) => String([door.start, door.end])));
  for (const doorway of home.facts.doorways) {
    if (!movable.has(String([doorway.start, doorway.end]))) drawDoorway(pen, doorway);
  }
  drawWalls(canvas, frame, ratio, outlines);
  drawNoGo(context, home, frame, ratio, colors);
}

/** An open door with its swing, or the threshold of an opening. */
function drawDoorway(pen: Pen, { start, end, leaf }: DoorwayFacts): void {
  const { context } = pen;
  const width = Math.hypot(end[0] - start[0], end[1] - start[1]);
  context.save();
  context.translate(...start);
  context.rotate(Math.atan2(end[1] - start[1], end[0] - start[0]));
  if (leaf) drawLeaf(pen, width);
  else {
    context.fillStyle = "rgba(122, 95, 60, 0.16)";
    context.fillRect(0, -0.075, width, 0.15);
  }
  context.restore();
}

/** A door that stands open at the left of an opening along the x axis. */
export function drawLeaf(pen: Pen, width: number): void {
  const { context } = pen;
  context.beginPath();
  context.moveTo(0, 0);
  context.arc(0, 0, width, 0, Math.PI / 2);
  context.closePath();
  context.fillStyle = "rgba(255, 255, 255, 0.2)";
  context.fill();
  context.beginPath();
  context.arc(0, 0, width, 0, Math.PI / 2);
  context.strokeStyle = "rgba(120, 95, 60, 0.5)";
  context.lineWidth = 0.018;
  context.setLineDash([0.07, 0.06]);
  context.stroke();
  context.setLineDash([]);
  pen.box(-0.028, 0, 0.028, width, LOOK.door, 0.02);
  pen.disc(0, Math.max(0, width - 0.1), 0.03, "#ebd9b6");
}

/** Walls rise from the floor: their shadow falls into the rooms, their faces look south. */
function drawWalls(canvas: HTMLCanvasElement, frame: Frame, ratio: number, outlines: Outlines): void {
  const context = canvas.getContext("2d")!;
  const scale = frame.scale * ratio;
  const mask = (color: string): HTMLCanvasElement => {
    const layer = document.createElement("canvas");
    layer.width = canvas.width;
    layer.height = canvas.height;
    const inner = layer.getContext("2d")!;
    frame.enter(inner, ratio);
    inner.fillStyle = color;
    inner.strokeStyle = color;
    outlines.fillHull(inner);
    inner.globalCompositeOperation = "destination-out";
    inner.fill(outlines.free, "evenodd");
    return layer;
  };
  const [face, edge, top] = [mask(WALL_FACE), mask(WALL_EDGE), mask(WALL_TOP)];
  context.save();
  context.clip(outlines.free, "evenodd");
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.shadowColor = WALL_SHADOW;
  context.shadowBlur = 0.3 * scale;
  context.shadowOffsetX = 0.09 * scale;
  context.shadowOffsetY = 0.13 * scale;
  context.drawImage(face, 0, 0);
  context.restore();
  context.setTransform(1, 0, 0, 1, 0, 0);
  const lift = Math.max(1, Math.round(LIFT_M * scale));
  for (let rise = 0; rise < lift; rise++) context.drawImage(face, 0, -rise);
  for (const [x, y] of [[-1, 0], [1, 0], [0, -1], [0, 1]] as const) context.drawImage(edge, x, y - lift);
  context.drawImage(top, 0, -lift);
  frame.enter(context, ratio);
}

function drawNoGo(context: Context, home: Home, frame: Frame, ratio: number, colors: Colors): void {
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  for (const area of home.facts.no_go) {
    tracePolygons(context, frame, [area]);
    context.strokeStyle = colors.alarm;
    context.lineWidth = 1;
    context.setLineDash([4, 3]);
    context.stroke();
    context.setLineDash([]);
  }
}

/** The scale of the plan, at its foot. */
export function drawScale(context: Context, home: Home, frame: Frame, colors: Colors, height: number): void {
  const [x0, , x1] = home.facts.bounds;
  const length = [50, 20, 10, 5, 2].find((metres) => metres <= (x1 - x0) / 3) ?? 1;
  const [x, y] = [24, height - 12];
  const wide = length * frame.scale;
  context.fillStyle = colors.quiet;
  context.fillRect(x, y, wide, 1.5);
  context.fillRect(x, y - 3, 1.5, 7.5);
  context.fillRect(x + wide, y - 3, 1.5, 7.5);
  context.font = "500 11px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillText(`${length} m`, x + wide + 8, y + 1);
}

/** An image with a pixel for each cell, its first row the lowest. */
export function cellImage(home: Home, color: (cell: number) => readonly [number, number, number, number] | null): HTMLCanvasElement {
  const { columns, rows } = home.facts;
  const canvas = document.createElement("canvas");
  canvas.width = columns;
  canvas.height = rows;
  const context = canvas.getContext("2d")!;
  const image = context.createImageData(columns, rows);
  for (let row = 0; row < rows; row++) {
    for (let column = 0; column < columns; column++) {
      const value = color(row * columns + column);
      if (value) image.data.set(value, 4 * ((rows - 1 - row) * columns + column));
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

export function drawCells(context: Context, home: Home, frame: Frame, image: HTMLCanvasElement): void {
  const { origin_units: [x, y], units_per_m: units, cell, columns, rows } = home.facts;
  const [left, bottom] = [x / units, y / units];
  context.imageSmoothingEnabled = false;
  context.drawImage(
    image,
    frame.x(left),
    frame.y(bottom + rows * cell),
    columns * cell * frame.scale,
    rows * cell * frame.scale,
  );
}
