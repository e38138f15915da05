/** Draw lanes, the axis of dates and times, and the cursor of a timeline. */

import type { Clock } from "../data/clock";
import { firstAtLeast, lastAtMost } from "../data/search";
import { type Colors } from "../theme";
import type { Lane, LanePaint } from "./lanes";

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

/** Height of all lanes and the axis. */
export function heightOf(lanes: readonly Lane[]): number {
  return AXIS_HEIGHT + lanes.reduce((sum, lane) => sum + lane.height + GAP, 0);
}

export function laneAt(lanes: readonly Lane[], y: number): Lane | null {
  let top = AXIS_HEIGHT;
  for (const lane of lanes) {
    if (y >= top && y < top + lane.height + GAP) return lane;
    top += lane.height + GAP;
  }
  return null;
}

export function drawLanes(context: Context, lanes: readonly Lane[], scale: Scale, clock: Clock, colors: Colors): void {
  drawAxis(context, scale, clock, colors, heightOf(lanes));
  let top = AXIS_HEIGHT;
  for (const lane of lanes) {
    context.fillStyle = colors.panel;
    context.fillRect(0, top, scale.width, lane.height);
    paintLane(context, lane.paint, scale, top, lane.height, colors);
    top += lane.height + GAP;
  }
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
  { beliefs, rows, truth, color, endUs }: Extract<LanePaint, { kind: "heat" }>,
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
}

function paintStretches(
  context: Context,
  paint: Extract<LanePaint, { kind: "stretches" }>,
  scale: Scale,
  top: number,
  height: number,
  colors: Colors,
): void {
  const { from, to, value } = paint.stretches;
  const pixel = (scale.to - scale.from) / scale.width;
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
  let last = -1;
  for (let i = firstAtLeast(us, scale.from); i < us.length && us[i]! <= scale.to; i++) {
    const x = Math.floor(xOf(scale, us[i]!));
    if (x === last) continue;
    last = x;
    context.fillRect(x, top, 1.5, height);
  }
}

function paintLine(
  context: Context,
  { series, color }: Extract<LanePaint, { kind: "line" }>,
  scale: Scale,
  top: number,
  height: number,
): void {
  const numbers = series.values.filter((value) => !Number.isNaN(value));
  const [low, high] = [Math.min(0, ...numbers), Math.max(...numbers, 1e-12)];
  context.strokeStyle = color;
  context.lineWidth = 1.2;
  context.beginPath();
  series.us.forEach((us, i) => {
    const value = series.values[i]!;
    if (Number.isNaN(value)) return;
    context.lineTo(xOf(scale, us), top + height - 2 - ((value - low) / (high - low || 1)) * (height - 4));
  });
  context.stroke();
}

const SECOND = 1e6;
const STEPS = [1, 5, 15, 30, 60, 300, 900, 1800, 3600, 7200, 10_800, 21_600, 43_200, 86_400, 172_800, 604_800, 2_592_000];

/** Distance between two ticks of the axis [us], so that about so many fit. */
export function tickStep(scale: Scale, pixels = 84): number {
  const leastStep = ((scale.to - scale.from) / scale.width) * pixels;
  return (STEPS.find((seconds) => seconds * SECOND >= leastStep) ?? STEPS[STEPS.length - 1]!) * SECOND;
}

function drawAxis(context: Context, scale: Scale, clock: Clock, colors: Colors, height: number): void {
  const step = tickStep(scale);
  const midnight = clock.dayStart(clock.day(scale.from));
  context.textBaseline = "middle";
  context.textAlign = "left";
  shadeNights(context, scale, clock, colors, height);
  for (let us = midnight; us <= scale.to; us += step) {
    if (us < scale.from - step) continue;
    const x = xOf(scale, us);
    context.fillStyle = colors.line;
    context.fillRect(Math.round(x), 18, 1, height);
    const atMidnight = clock.timeText(us) === "00:00:00";
    context.fillStyle = atMidnight ? colors.text : colors.quiet;
    context.font = `${atMidnight ? "600 " : ""}11px system-ui, sans-serif`;
    const words = step >= 86_400 * SECOND || atMidnight ? clock.dateText(us) : clock.timeText(us, step < 60 * SECOND);
    context.fillText(words, x + 4, 25);
  }
  context.fillStyle = colors.text;
  context.font = "600 11px system-ui, sans-serif";
  context.fillText(`${clock.dateText(Math.max(0, scale.from))} · day ${clock.day(Math.max(0, scale.from))}`, 4, 8);
}

/** Tint the nights of a view of at most some weeks. */
function shadeNights(context: Context, scale: Scale, clock: Clock, colors: Colors, height: number): void {
  if (scale.to - scale.from > 45 * 86_400e6) return;
  context.fillStyle = colors.panel;
  for (let day = clock.day(scale.from); clock.dayStart(day) < scale.to; day++) {
    const midnight = clock.dayStart(day);
    const [left, right] = [xOf(scale, midnight - 2 * 3600e6), xOf(scale, midnight + 6 * 3600e6)];
    context.fillRect(left, 18, right - left, height);
  }
}

export function drawCursor(context: Context, x: number, height: number, words: string, width: number, colors: Colors): void {
  context.fillStyle = colors.cursor;
  context.fillRect(Math.round(x) - 1, 14, 2, height);
  context.font = "600 11px system-ui, sans-serif";
  const wide = context.measureText(words).width + 10;
  const left = Math.max(0, Math.min(width - wide, x - wide / 2));
  context.beginPath();
  context.roundRect(left, 0, wide, 16, 4);
  context.fill();
  context.fillStyle = colors.ground;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillText(words, left + 5, 8.5);
}
