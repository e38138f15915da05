/** Draw lanes, the axis of dates and times, and the cursor of a timeline. */

import { type Clock, DAY_US } from "../data/clock";
import { firstAtLeast, lastAtMost } from "../data/search";
import { type Colors } from "../theme";
import type { LanePaint } from "./lanes";
import { levelOf } from "./levels";
import type { Row } from "./rows";

export const AXIS_HEIGHT = 34;
export const GAP = 3;

type Context = CanvasRenderingContext2D;

export interface Scale {
  from: number;
  to: number;
  width: number;
}

export function xOf(scale: Scale, us: number): number {
  return ((us - scale.from) / (scale.to - scale.from)) * scale.width;
}

export function usOf(scale: Scale, x: number): number {
  return scale.from + (x / scale.width) * (scale.to - scale.from);
}

/** A row where it is drawn: `top` in pixels from the top of the canvas. */
export interface PlacedRow extends Row {
  top: number;
}

/** Height of all rows and the axis. */
export function heightOf(rows: readonly Row[]): number {
  return AXIS_HEIGHT + rows.reduce((sum, row) => sum + row.height + GAP, 0);
}

/** The rows that are seen in a view that is scrolled; those that are pinned stay at its top. */
export function visibleRows(rows: readonly Row[], scrolled: number, height: number): PlacedRow[] {
  const placed: PlacedRow[] = [];
  let [top, pinnedEnd] = [AXIS_HEIGHT, AXIS_HEIGHT];
  for (const row of rows) {
    const at = row.isPinned ? top : top - scrolled;
    top += row.height + GAP;
    if (row.isPinned) pinnedEnd = top;
    if (at >= height) break;
    if (at + row.height > (row.isPinned ? 0 : pinnedEnd)) placed.push({ ...row, top: at });
  }
  return placed;
}

export function rowAt(rows: readonly PlacedRow[], y: number): PlacedRow | null {
  if (y < AXIS_HEIGHT) return null;
  return rows.find((row) => y >= row.top && y < row.top + row.height + GAP) ?? null;
}

/** Draw the rows that are seen; those that scroll come first, and are covered by the pinned ones and the axis. */
export function drawRows(context: Context, rows: readonly PlacedRow[], scale: Scale, clock: Clock, colors: Colors, height: number): void {
  shadeNights(context, scale, clock, colors, height);
  drawGrid(context, scale, clock, colors, height);
  for (const row of [...rows].sort((a, b) => Number(a.isPinned) - Number(b.isPinned))) {
    context.fillStyle = row.isPinned ? colors.ground : colors.panel;
    if (row.isPinned) context.fillRect(0, row.top - GAP, scale.width, row.height + 2 * GAP);
    if (!row.lane) continue;
    context.fillStyle = colors.panel;
    context.fillRect(0, row.top, scale.width, row.height);
    paintLane(context, row.lane.paint(), scale, row.top, row.height, colors);
  }
  context.fillStyle = colors.ground;
  context.fillRect(0, 0, scale.width, AXIS_HEIGHT - GAP);
  drawAxis(context, scale, clock, colors);
}

function paintLane(context: Context, paint: LanePaint, scale: Scale, top: number, height: number, colors: Colors): void {
  if (paint.kind === "stretches") paintStretches(context, paint, scale, top, height, colors);
  else if (paint.kind === "ticks") paintTicks(context, paint.us, paint.color, scale, top, height);
  else if (paint.kind === "heat") paintHeat(context, paint, scale, top, height, colors);
  else paintLine(context, paint, scale, top, height);
}

/** A row a room, the darker the more is believed of it; where the user really is as a line. */
function paintHeat(
  context: Context,
  { beliefs, rows, names, truth, color, endUs }: Extract<LanePaint, { kind: "heat" }>,
  scale: Scale,
  top: number,
  height: number,
  colors: Colors,
): void {
  const tall = height / rows.length;
  context.fillStyle = color;
  let i = Math.max(0, lastAtMost(beliefs.us, scale.from));
  while (i < beliefs.us.length && beliefs.us[i]! <= scale.to) {
    const left = Math.max(0, xOf(scale, beliefs.us[i]!));
    let next = i + 1; // of the outputs within a pixel the first is shown
    while (next < beliefs.us.length && xOf(scale, beliefs.us[next]!) < left + 1) next++;
    const right = Math.min(scale.width, xOf(scale, beliefs.us[next] ?? endUs));
    rows.forEach((room, row) => {
      context.globalAlpha = Math.min(1, beliefs.shares[i]![room]!);
      context.fillRect(left, top + row * tall, right - left, tall - 1);
    });
    i = next;
  }
  context.globalAlpha = 1;
  context.fillStyle = colors.text;
  for (let k = Math.max(0, firstAtLeast(truth.to, scale.from)); k < truth.from.length && truth.from[k]! <= scale.to; k++) {
    const row = rows.indexOf(truth.value[k]!);
    if (row < 0) continue;
    const [left, right] = [Math.max(0, xOf(scale, truth.from[k]!)), Math.min(scale.width, xOf(scale, truth.to[k]!))];
    context.fillRect(left, top + (row + 0.5) * tall - 1.5, Math.max(1, right - left), 2);
  }
  context.font = "9px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.textAlign = "left";
  names.forEach((name, row) => writeInside(context, name, 0, top + (row + 0.5) * tall - 0.5, scale.width, colors));
}

function paintStretches(
  context: Context,
  paint: Extract<LanePaint, { kind: "stretches" }>,
  scale: Scale,
  top: number,
  height: number,
  colors: Colors,
): void {
  const pixel = (scale.to - scale.from) / scale.width;
  const { from, to, value } = levelOf(paint.stretches, pixel, paint.rank);
  context.font = "10px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.textAlign = "left";
  for (let i = Math.max(0, firstAtLeast(to, scale.from)); i < from.length; i++) {
    if (from[i]! > scale.to) break;
    const color = paint.color(value[i]!);
    if (!color) continue;
    const [left, right] = [Math.max(0, xOf(scale, from[i]!)), Math.min(scale.width, xOf(scale, to[i]!))];
    const width = Math.max(right - left, Math.min(1, (to[i]! - from[i]!) / pixel + 0.15));
    context.fillStyle = color;
    context.fillRect(left, top, width, height);
    if (width > 34 && height >= 14) writeInside(context, paint.label(value[i]!), left, top + height / 2, width, colors);
  }
}

function writeInside(context: Context, words: string, left: number, y: number, width: number, colors: Colors): void {
  const text = words.replaceAll("_", " ");
  if (context.measureText(text).width > width - 8) return;
  context.strokeStyle = colors.halo;
  context.lineWidth = 2.5;
  context.strokeText(text, left + 4, y);
  context.fillStyle = colors.text;
  context.fillText(text, left + 4, y);
}

function paintTicks(context: Context, us: readonly number[], color: string, scale: Scale, top: number, height: number): void {
  context.fillStyle = color;
  for (let i = firstAtLeast(us, scale.from); i < us.length && us[i]! <= scale.to; ) {
    const x = Math.floor(xOf(scale, us[i]!));
    context.fillRect(x, top, 1.5, height);
    i = Math.max(i + 1, firstAtLeast(us, usOf(scale, x + 1))); // of those within a pixel one is drawn
  }
}

function paintLine(
  context: Context,
  { series, extent: [low, high], color }: Extract<LanePaint, { kind: "line" }>,
  scale: Scale,
  top: number,
  height: number,
): void {
  const y = (value: number): number => top + height - 2 - ((value - low) / (high - low || 1)) * (height - 4);
  context.strokeStyle = color;
  context.lineWidth = 1.2;
  context.beginPath();
  // Of the values within a pixel the first, the least and the greatest are drawn.
  let i = Math.max(0, lastAtMost(series.us, scale.from));
  while (i < series.us.length) {
    const x = xOf(scale, series.us[i]!);
    const end = Math.max(i + 1, firstAtLeast(series.us, usOf(scale, x + 1)));
    let [least, most] = [Infinity, -Infinity];
    for (let k = i; k < end; k++) {
      const value = series.values[k]!;
      if (value < least) least = value;
      if (value > most) most = value;
    }
    if (least <= most) {
      context.lineTo(x, y(series.values[i]! >= least ? series.values[i]! : least));
      if (end > i + 1) {
        context.lineTo(x, y(least));
        context.lineTo(x, y(most));
      }
    }
    if (x > scale.width) break;
    i = end;
  }
  context.stroke();
}

const SECOND = 1e6;
const STEPS = [1, 5, 15, 30, 60, 300, 900, 1800, 3600, 7200, 10_800, 21_600, 43_200, 86_400, 172_800, 604_800, 1_209_600, 2_592_000];

/** Distance between two ticks of the axis [us], so that about so many fit. */
export function tickStep(scale: Scale, pixels = 84): number {
  const leastStep = ((scale.to - scale.from) / scale.width) * pixels;
  return (STEPS.find((seconds) => seconds * SECOND >= leastStep) ?? STEPS[STEPS.length - 1]!) * SECOND;
}

/** The ticks of the axis in view: at round readings of the clock, also on days on which it is changed. */
export function* ticks(scale: Scale, clock: Clock): Generator<number> {
  const step = tickStep(scale);
  const days = Math.max(1, Math.round(step / DAY_US));
  for (let day = clock.day(scale.from); clock.dayStart(day) <= scale.to; day += days) {
    const reached = clock.share(Math.max(scale.from, clock.dayStart(day)), day) * DAY_US;
    for (let at = Math.max(0, Math.floor(reached / step) - 1) * step; at < DAY_US; at += step) {
      const us = clock.ofShare(at / DAY_US, day);
      if (us > scale.to) return;
      yield us;
    }
  }
}

function drawGrid(context: Context, scale: Scale, clock: Clock, colors: Colors, height: number): void {
  context.fillStyle = colors.line;
  for (const us of ticks(scale, clock)) context.fillRect(Math.round(xOf(scale, us)), 18, 1, height);
}

function drawAxis(context: Context, scale: Scale, clock: Clock, colors: Colors): void {
  const step = tickStep(scale);
  context.textBaseline = "middle";
  context.textAlign = "left";
  for (const us of ticks(scale, clock)) {
    const x = xOf(scale, us);
    context.fillStyle = colors.line;
    context.fillRect(Math.round(x), 18, 1, AXIS_HEIGHT - GAP - 18);
    const atMidnight = clock.timeText(us) === "00:00:00";
    context.fillStyle = atMidnight ? colors.text : colors.quiet;
    context.font = `${atMidnight ? "600 " : ""}11px system-ui, sans-serif`;
    const words = step >= 86_400 * SECOND || atMidnight ? clock.dateText(us) : clock.timeText(us, step < 60 * SECOND);
    context.fillText(words, x + 4, 25);
  }
  if (step >= 86_400 * SECOND) return; // the ticks are dates
  context.fillStyle = colors.text;
  context.font = "600 11px system-ui, sans-serif";
  context.fillText(`${clock.dateText(Math.max(0, scale.from))} · day ${clock.day(Math.max(0, scale.from))}`, 4, 8);
}

/** Tint the nights of a view of at most some weeks. */
function shadeNights(context: Context, scale: Scale, clock: Clock, colors: Colors, height: number): void {
  if (scale.to - scale.from > 45 * DAY_US) return;
  context.fillStyle = colors.panel;
  for (let day = clock.day(scale.from); clock.dayStart(day) < scale.to; day++) {
    const midnight = clock.dayStart(day);
    const [left, right] = [xOf(scale, midnight - 2 * 3600e6), xOf(scale, midnight + 6 * 3600e6)];
    context.fillRect(left, 18, right - left, height);
  }
}

/** Tint the range that was marked for its totals. */
export function drawMarked(context: Context, scale: Scale, marked: readonly [number, number], height: number, colors: Colors): void {
  const [left, right] = marked.map((us) => xOf(scale, us)).sort((a, b) => a - b) as [number, number];
  context.fillStyle = colors.cursor;
  context.globalAlpha = 0.15;
  context.fillRect(left, AXIS_HEIGHT - GAP, right - left, height);
  context.globalAlpha = 1;
}
