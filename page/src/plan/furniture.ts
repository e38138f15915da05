/** Symbols of furniture, whose shapes come with the facts of a home; seen from above, their front at the top. */

import { LOOK, type ObjectFacts, type ShapeFacts } from "../contract";
import { Pen } from "./pen";

type Context = CanvasRenderingContext2D;

const SHADOW = "rgba(60, 45, 25, 0.34)";
const LINE_M = 0.02;
/** Blur and offsets of the shadows of pieces that hide somebody, and of lower ones [m]. */
const SHADOWS = { sight: [0.28, 0.08, 0.1], path: [0.16, 0.04, 0.06] } as const;

/** Draw a piece: its symbol, or its outline where it is slanted or has many corners. */
export function drawPiece(context: Context, thing: ObjectFacts, symbols: readonly (readonly ShapeFacts[])[], scale: number): void {
  const symbol = symbols[thing.symbol];
  context.save();
  context.lineWidth = LINE_M;
  if (thing.blocks !== "nothing") {
    const [blur, x, y] = SHADOWS[thing.blocks === "sight" ? "sight" : "path"];
    context.shadowColor = SHADOW;
    context.shadowBlur = blur * scale;
    context.shadowOffsetX = x * scale;
    context.shadowOffsetY = y * scale;
  }
  if (!symbol || thing.blocks !== "nothing") {
    traceOutline(context, thing);
    context.fillStyle = LOOK.outline.fill;
    context.fill();
  }
  context.shadowColor = "transparent";
  if (symbol) {
    context.translate(...thing.middle);
    context.rotate(thing.front - Math.PI / 2);
    const pen = new Pen(context);
    for (const shape of symbol) drawShape(pen, shape);
  } else {
    context.strokeStyle = LOOK.outline.edge;
    context.stroke();
  }
  context.restore();
}

function drawShape(pen: Pen, { kind, at: [x0, y0, x1, y1], fill, edge, radius }: ShapeFacts): void {
  if (kind === "box") pen.box(x0, y0, x1, y1, fill, radius, edge);
  else if (kind === "ellipse") pen.ellipse((x0 + x1) / 2, (y0 + y1) / 2, (x1 - x0) / 2, (y1 - y0) / 2, fill, edge);
  else if (edge) pen.line(x0, y0, x1, y1, edge);
}

function traceOutline(context: Context, thing: ObjectFacts): void {
  context.beginPath();
  thing.outline.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
  context.closePath();
}
