/** Symbols of furniture, by type: seen from above, their front at the top. Drawn in metres. */

import type { ObjectFacts } from "../contract";
import { Pen } from "./pen";

type Context = CanvasRenderingContext2D;
/** Draws a symbol `wide` metres across and `deep` metres to the front, its middle at (0, 0). */
type Symbol = (pen: Pen, wide: number, deep: number) => void;

const OAK = "#c99f6c";
const DARK_OAK = "#b98c58";
const PALE_OAK = "#d6bc93";
const CLOTH = "#6f8791";
const SEAT = "#97adb5";
const WHITE = "#ffffff";
const ENAMEL_EDGE = "#c3c8cb";
const DRAIN = "#8c959b";
const TAP = "#949ca3";
const SHADOW = "rgba(60, 45, 25, 0.34)";

/** The whole of a piece, less a margin. */
function slab(pen: Pen, wide: number, deep: number, color: string, radius = 0.04, edge: string | null = null): void {
  pen.box(-wide / 2, -deep / 2, wide / 2, deep / 2, color, radius, edge);
}

function bed(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, DARK_OAK, 0.06);
  pen.box(-wide / 2 + 0.04, -deep / 2 + 0.1, wide / 2 - 0.04, deep / 2 - 0.02, "#f7f5f0", 0.08);
  const pillows = wide > 1.2 ? 2 : 1;
  const pitch = (wide - 0.2) / pillows;
  for (let i = 0; i < pillows; i++) {
    const left = -wide / 2 + 0.13 + i * pitch;
    pen.box(left, -deep / 2 + 0.16, left + pitch - 0.06, -deep / 2 + 0.52, WHITE, 0.1, "#cfcac0");
  }
  pen.box(-wide / 2 + 0.04, -deep / 2 + 0.68, wide / 2 - 0.04, deep / 2 - 0.02, "#9fb0c9", 0.08);
  pen.box(-wide / 2 + 0.04, -deep / 2 + 0.68, wide / 2 - 0.04, -deep / 2 + 0.9, "#c5d0e0", 0.05);
}

function sofa(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, CLOTH, 0.12);
  const seats = wide > 1.9 ? 3 : 2;
  const pitch = (wide - 0.32) / seats;
  for (let i = 0; i < seats; i++) {
    const left = -wide / 2 + 0.18 + i * pitch;
    pen.box(left, -deep / 2 + 0.24, left + pitch - 0.04, deep / 2 - 0.05, SEAT, 0.07);
  }
  pen.box(-wide / 2 + 0.2, -deep / 2 + 0.14, -wide / 2 + 0.52, -deep / 2 + 0.36, "#d8a66b", 0.07);
}

function armchair(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, CLOTH, 0.12);
  pen.box(-wide / 2 + 0.14, -deep / 2 + 0.2, wide / 2 - 0.14, deep / 2 - 0.03, SEAT, 0.08);
}

function chair(pen: Pen, wide: number, deep: number): void {
  pen.box(-wide / 2 + 0.03, -deep / 2 + 0.03, wide / 2 - 0.03, deep / 2, "#d9b585", 0.08);
  pen.box(-wide / 2 + 0.02, -deep / 2, wide / 2 - 0.02, -deep / 2 + 0.09, DARK_OAK, 0.04);
}

function table(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, OAK, 0.08);
  for (let y = -deep / 2 + 0.14; y < deep / 2; y += 0.17) pen.line(-wide / 2 + 0.06, y, wide / 2 - 0.06, y, "#ffffff3a");
}

function coffeeTable(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, OAK, 0.12);
  pen.box(-0.2, -0.1, 0.08, 0.1, "#f2efe8", 0.02);
}

function desk(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, OAK);
  pen.box(-0.34, -deep / 2 + 0.08, 0.34, -deep / 2 + 0.14, "#2f363d", 0.02);
  pen.box(-0.22, -0.02, 0.22, 0.14, "#edebe6", 0.02);
}

function bench(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, OAK, 0.06);
  pen.box(-wide / 2 + 0.05, -deep / 2 + 0.06, wide / 2 - 0.05, deep / 2 - 0.04, "#c9bfae", 0.06);
}

function wardrobe(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#cdb48f", 0.03);
  pen.box(-wide / 2 + 0.03, -deep / 2 + 0.03, wide / 2 - 0.03, deep / 2 - 0.07, "#dcc7a6", 0.02);
  const doors = Math.max(2, Math.round(wide / 0.55));
  for (let i = 1; i < doors; i++) {
    const x = -wide / 2 + (wide * i) / doors;
    pen.line(x, -deep / 2 + 0.03, x, deep / 2, DARK_OAK);
  }
}

const BOOKS = ["#8c9fb3", "#c98f6b", "#7fa08c", "#d8c28a", "#a58aa8"];

function bookshelf(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, DARK_OAK, 0.02);
  const books = Math.floor((wide - 0.14) / 0.07);
  for (let i = 0; i < books; i++) {
    const left = -wide / 2 + 0.05 + i * 0.07;
    pen.box(left, -deep / 2 + 0.05, left + 0.055, deep / 2 - 0.06 - (i % 3) * 0.02, BOOKS[i % BOOKS.length]!, 0.01);
  }
}

const BOXES = ["#e4d9c4", "#bfc9cc", "#d9c7a8"];

function shelf(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#cdbfa8", 0.02);
  const boxes = Math.floor((wide - 0.1) / 0.3);
  for (let i = 0; i < boxes; i++) {
    const left = -wide / 2 + 0.06 + i * 0.3;
    pen.box(left, -deep / 2 + 0.06, left + 0.24, deep / 2 - 0.05, BOXES[i % BOXES.length]!, 0.03);
  }
}

function dresser(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, PALE_OAK, 0.03);
  pen.line(0, deep / 2 - 0.1, 0, deep / 2, DARK_OAK);
  pen.line(-wide / 2, deep / 2 - 0.1, wide / 2, deep / 2 - 0.1, DARK_OAK);
}

function nightstand(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, PALE_OAK);
  pen.disc(0, 0, Math.min(0.12, deep / 3), "#fff3d0", "#d9c48f");
}

function tv(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#cdb48f");
  pen.box(-wide / 2 + 0.1, -0.05, wide / 2 - 0.1, 0.05, "#20262c", 0.02);
}

function fridge(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#e6e9eb", 0.05, "#b6bcc1");
  pen.line(-wide / 2, deep / 2 - 0.09, wide / 2, deep / 2 - 0.09, "#b6bcc1");
  pen.box(wide / 2 - 0.14, deep / 2 - 0.05, wide / 2 - 0.05, deep / 2 - 0.01, "#8c949b", 0.01);
}

function counter(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#f1eee8", 0.01);
  pen.box(-wide / 2, deep / 2 - 0.07, wide / 2, deep / 2, "#cdb48f", 0);
}

function stove(pen: Pen, wide: number, deep: number): void {
  counter(pen, wide, deep);
  pen.box(-wide / 2 + 0.05, -deep / 2 + 0.05, wide / 2 - 0.05, deep / 2 - 0.11, "#2c3238", 0.03);
  for (const x of [-wide / 4.4, wide / 4.4]) {
    for (const y of [-deep / 4.4, deep / 8]) pen.disc(x, y, 0.08, null, "#8f979e");
  }
}

function sink(pen: Pen, wide: number, deep: number): void {
  counter(pen, wide, deep);
  pen.box(-wide / 2 + 0.09, -deep / 2 + 0.12, wide / 2 - 0.09, deep / 2 - 0.12, "#c8cdd2", 0.07, "#a8afb5");
  pen.disc(0, 0, 0.035, "#7d868d");
  pen.box(-0.02, -deep / 2 + 0.04, 0.02, -deep / 2 + 0.24, TAP, 0.02);
}

function washbasin(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, WHITE, 0.1, ENAMEL_EDGE);
  pen.box(-wide / 2 + 0.08, -deep / 2 + 0.12, wide / 2 - 0.08, deep / 2 - 0.06, "#e3edef", 0.2);
  pen.disc(0, 0.02, 0.03, DRAIN);
  pen.box(-0.02, -deep / 2 + 0.03, 0.02, -deep / 2 + 0.18, TAP, 0.02);
}

function toilet(pen: Pen, wide: number, deep: number): void {
  pen.box(-wide / 2, -deep / 2, wide / 2, -deep / 2 + 0.2, WHITE, 0.04, ENAMEL_EDGE);
  pen.ellipse(0, 0.08, wide / 2 - 0.02, deep / 2 - 0.1, WHITE, ENAMEL_EDGE);
  pen.ellipse(0, 0.09, wide / 2 - 0.09, deep / 2 - 0.19, "#dde8ea");
}

function bathtub(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, WHITE, 0.08, ENAMEL_EDGE);
  pen.box(-wide / 2 + 0.08, -deep / 2 + 0.09, wide / 2 - 0.08, deep / 2 - 0.09, "#d5e7eb", 0.26);
  pen.disc(wide / 2 - 0.24, 0, 0.035, DRAIN);
}

function shower(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#cfe3e866", 0.02, "#9fb9c0");
  pen.line(-wide / 2, -deep / 2, wide / 2, deep / 2, "#9fb9c088");
  pen.line(wide / 2, -deep / 2, -wide / 2, deep / 2, "#9fb9c088");
  pen.disc(0, 0, 0.06, "#a9bcc2");
}

function washingMachine(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#f4f5f5", 0.05, ENAMEL_EDGE);
  pen.disc(0, 0.02, 0.2, "#b9c7ce", "#9aa4aa");
  pen.disc(0, 0.02, 0.12, "#8fa5b0");
}

function rug(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#b9a58c66", 0.05, "#9a876e66");
}

function glass(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#bcd9e377", 0, "#8fb4c1");
}

function charger(pen: Pen, wide: number, deep: number): void {
  slab(pen, wide, deep, "#2c3338", 0.06);
  pen.box(-0.07, -0.02, 0.07, 0.02, "#3fd0c9", 0.02);
}

const SYMBOLS: Record<string, Symbol> = {
  bed,
  sofa,
  armchair,
  chair,
  table,
  coffee_table: coffeeTable,
  desk,
  bench,
  wardrobe,
  bookshelf,
  shelf,
  dresser,
  nightstand,
  tv,
  fridge,
  kitchen_counter: counter,
  stove,
  sink,
  washbasin,
  toilet,
  bathtub,
  shower,
  washing_machine: washingMachine,
  rug,
  glass,
  charger,
};

/** The symbol of a piece within the box of its outline; a slanted or many-cornered piece is drawn as it is. */
export function drawPiece(context: Context, thing: ObjectFacts, scale: number): void {
  const [wide, deep, x, y] = boxOf(thing);
  const isBox = thing.outline.length === 4 && isUpright(thing);
  const blocksSight = thing.blocks === "sight";
  context.save();
  context.lineWidth = 0.02;
  if (thing.blocks !== "nothing") {
    context.shadowColor = SHADOW;
    context.shadowBlur = (blocksSight ? 0.28 : 0.16) * scale;
    context.shadowOffsetX = (blocksSight ? 0.08 : 0.04) * scale;
    context.shadowOffsetY = (blocksSight ? 0.1 : 0.06) * scale;
  }
  if (!isBox) {
    traceOutline(context, thing);
    context.fillStyle = "#d9d2c6";
    context.fill();
    context.shadowColor = "transparent";
    context.strokeStyle = "#8b857b";
    context.stroke();
    context.restore();
    return;
  }
  context.translate(x, y);
  context.rotate(thing.front - Math.PI / 2);
  const pen = new Pen(context);
  if (thing.blocks !== "nothing") pen.box(-wide / 2 + 0.02, -deep / 2 + 0.02, wide / 2 - 0.02, deep / 2 - 0.02, "#b7a78f", 0.06);
  context.shadowColor = "transparent";
  const symbol = SYMBOLS[thing.type];
  if (symbol) symbol(pen, wide, deep);
  else slab(pen, wide, deep, "#d9d8d4", 0.04, "#8b857b");
  context.restore();
}

function traceOutline(context: Context, thing: ObjectFacts): void {
  context.beginPath();
  thing.outline.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
  context.closePath();
}

/** Width across, depth to the front, and the middle of a piece [m]. */
function boxOf({ outline, front }: ObjectFacts): [number, number, number, number] {
  const [xs, ys] = [outline.map(([x]) => x), outline.map(([, y]) => y)];
  const [left, right, bottom, top] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const looksAside = Math.abs(Math.cos(front)) > Math.SQRT1_2;
  const [wide, deep] = looksAside ? [top - bottom, right - left] : [right - left, top - bottom];
  return [wide, deep, (left + right) / 2, (bottom + top) / 2];
}

/** Whether sides and front are along the axes. */
function isUpright({ outline, front }: ObjectFacts): boolean {
  const sides = outline.every(([x, y], i) => {
    const [u, v] = outline[(i + 1) % outline.length]!;
    return Math.abs(x - u) < 1e-3 || Math.abs(y - v) < 1e-3;
  });
  return sides && Math.abs(Math.sin(2 * front)) < 0.02;
}
