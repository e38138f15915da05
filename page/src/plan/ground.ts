/** What of the plan stands still: walls, rooms, furniture, names. Drawn once for each size. */

import type { ObjectFacts } from "../contract";
import type { Home } from "../data/home";
import { type Colors, rgb, roomColor } from "../theme";
import type { Frame } from "./frame";

const WALL_M = 0.15;

export interface GroundOptions {
  colors: Colors;
  dark: boolean;
  names: boolean;
  furniture: boolean;
}

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

export function drawGround(context: Context, home: Home, frame: Frame, options: GroundOptions): void {
  const { facts } = home;
  const rings = facts.free.flat();
  tracePolygons(context, frame, rings);
  context.strokeStyle = options.colors.wall;
  context.lineWidth = 2 * WALL_M * frame.scale;
  context.lineJoin = "miter";
  context.miterLimit = 3;
  context.stroke();
  context.save();
  tracePolygons(context, frame, rings);
  context.clip("evenodd");
  drawCells(context, home, frame, roomImage(home, options.dark));
  context.restore();
  if (options.furniture) facts.objects.forEach((thing) => drawObject(context, frame, thing, options.colors));
  if (options.furniture && options.names) facts.objects.forEach((thing) => nameObject(context, frame, thing, options.colors));
  for (const area of facts.no_go) {
    tracePolygons(context, frame, [area]);
    context.strokeStyle = options.colors.alarm;
    context.lineWidth = 1;
    context.setLineDash([4, 3]);
    context.stroke();
    context.setLineDash([]);
  }
  if (options.names) drawNames(context, home, frame, options.colors);
  drawScale(context, home, frame, options.colors);
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

const images = new WeakMap<Home, Map<boolean, HTMLCanvasElement>>();

function roomImage(home: Home, dark: boolean): HTMLCanvasElement {
  let byTheme = images.get(home);
  if (!byTheme) images.set(home, (byTheme = new Map()));
  let image = byTheme.get(dark);
  if (!image) {
    const table = home.facts.rooms.map((room) => [...rgb(roomColor(room.color, room.deep_color, dark)), 255] as const);
    const spread = spreadCells(home);
    image = cellImage(home, (cell) => (table[spread[cell]!] as [number, number, number, number] | undefined) ?? null);
    byTheme.set(dark, image);
  }
  return image;
}

/** Rooms grown by two cells into what isn't free, so that their colour reaches slanted walls. */
function spreadCells(home: Home): Int16Array {
  const { columns } = home.facts;
  let cells = home.cells;
  for (let round = 0; round < 2; round++) {
    const grown = Int16Array.from(cells);
    cells.forEach((room, i) => {
      if (room < 0) {
        grown[i] = Math.max(cells[i - 1] ?? -1, cells[i + 1] ?? -1, cells[i - columns] ?? -1, cells[i + columns] ?? -1);
      }
    });
    cells = grown;
  }
  return cells;
}

function drawObject(context: Context, frame: Frame, thing: ObjectFacts, colors: Colors): void {
  tracePolygons(context, frame, [thing.outline]);
  if (thing.blocks !== "nothing") {
    context.fillStyle = colors.furniture;
    context.fill();
  }
  context.strokeStyle = colors.furnitureEdge;
  context.lineWidth = thing.blocks === "sight" ? 1.6 : 0.8;
  context.stroke();
}

/** Name a piece of furniture if the name fits into it. */
function nameObject(context: Context, frame: Frame, thing: ObjectFacts, colors: Colors): void {
  const [xs, ys] = [0, 1].map((axis) => thing.outline.map((corner) => corner[axis]!)) as [number[], number[]];
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const words = thing.type.replaceAll("_", " ");
  context.font = "9px system-ui, sans-serif";
  const [wide, tall] = [(right - left) * frame.scale, (Math.max(...ys) - Math.min(...ys)) * frame.scale];
  if (context.measureText(words).width > wide - 2 || tall < 11) return;
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = colors.quiet;
  context.fillText(words, frame.x((left + right) / 2), frame.y((Math.min(...ys) + Math.max(...ys)) / 2));
}

/** Write the names of rooms. */
export function drawNames(context: Context, home: Home, frame: Frame, colors: Colors): void {
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineJoin = "round";
  for (const room of home.facts.rooms) {
    const size = Math.min(13, Math.max(0, 0.28 * frame.scale, Math.sqrt(room.area_m2) * frame.scale * 0.07));
    if (size < 6) continue;
    context.font = `${size}px system-ui, sans-serif`;
    const [x, y] = [frame.x(room.anchor[0]), frame.y(room.anchor[1])];
    const words = room.name.replaceAll("_", " ");
    if (context.measureText(words).width > 1.6 * Math.sqrt(room.area_m2) * frame.scale) continue;
    context.strokeStyle = colors.halo;
    context.lineWidth = 3;
    context.strokeText(words, x, y);
    context.fillStyle = colors.text;
    context.fillText(words, x, y);
  }
}

function drawScale(context: Context, home: Home, frame: Frame, colors: Colors): void {
  const [x0, y0, x1] = home.facts.bounds;
  const length = [50, 20, 10, 5, 2].find((metres) => metres <= (x1 - x0) / 3) ?? 1;
  const [x, y] = [frame.x(x0), frame.y(y0) + 0.15 * frame.scale + 8];
  context.fillStyle = colors.quiet;
  context.fillRect(x, y, length * frame.scale, 2);
  context.font = "11px system-ui, sans-serif";
  context.textAlign = "left";
  context.textBaseline = "top";
  context.fillText(`${length} m`, x, y + 4);
}
