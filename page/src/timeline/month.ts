/** Draw the rows of a calendar: what people did on each day, and when robots had them in view. */

import type { Clock } from "../data/clock";
import type { Run } from "../data/run";
import { firstAtLeast } from "../data/search";
import * as state from "../state";
import { colors } from "../theme";
import { type Crowd, CELLS_A_DAY } from "./crowd";
import { type Strip, timeWithin } from "./days";
import { HEAD, LEFT, RIGHT, type Sheet } from "./sheet";

type Context = CanvasRenderingContext2D;

const HOURS = [0, 3, 6, 9, 12, 15, 18, 21, 24];
const BAR = 56;
/** Below lower strips, when people were in view would only be noise [px]. */
const LEAST_WITH_VIEW = 5;
/** The bar of the time in view is full at so many hours a person. */
const MOST_IN_VIEW_H = 4;

export function drawMonth(context: Context, run: Run, strips: readonly Strip[], crowd: Crowd | null, sheet: Sheet): void {
  context.clearRect(0, 0, sheet.width, sheet.height);
  for (const day of sheet.visible) {
    drawDate(context, run.clock, sheet, day);
    if (crowd) drawCrowdDay(context, crowd, sheet, day);
    else drawStrips(context, run.clock, strips, sheet, day);
    if (sheet.hasTotals) drawInView(context, run.clock, strips, sheet, day);
  }
  drawFrames(context, run, sheet);
  context.clearRect(0, 0, sheet.width, HEAD - 2);
  drawHours(context, sheet);
}

function drawHours(context: Context, sheet: Sheet): void {
  context.font = "500 11px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.fillStyle = colors.value.quiet;
  context.textAlign = "center";
  for (const hour of HOURS) context.fillText(String(hour).padStart(2, "0"), LEFT + (hour / 24) * sheet.wide, HEAD / 2);
  if (!sheet.hasTotals) return;
  context.textAlign = "left";
  context.fillText("In view", sheet.width - RIGHT + 12, HEAD / 2);
}

function drawDate(context: Context, clock: Clock, sheet: Sheet, day: number): void {
  const date = clock.dateText(clock.dayStart(day));
  const isWeekend = /^S[au]/.test(date);
  context.font = `${isWeekend ? 600 : 400} ${Math.min(11.5, sheet.rowHeight)}px system-ui, sans-serif`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillStyle = isWeekend ? colors.value.text : colors.value.quiet;
  context.fillText(date, 12, sheet.top(day) + sheet.tall / 2);
}

/** A strip a person, and below it when robots had the person in view. */
function drawStrips(context: Context, clock: Clock, strips: readonly Strip[], sheet: Sheet, day: number): void {
  const begin = clock.dayStart(day);
  const end = clock.dayStart(day + 1);
  const height = sheet.tall / Math.max(1, strips.length);
  strips.forEach((strip, k) => {
    const y = sheet.top(day) + Math.round(k * height);
    const tall = Math.round((k + 1) * height) - Math.round(k * height) - (height < LEAST_WITH_VIEW ? 0 : 0.6);
    const { from, to, value } = strip.stretches;
    for (let i = firstAtLeast(to, begin + 1); i < from.length && from[i]! < end; i++) {
      const left = sheet.x(from[i]!, day);
      context.fillStyle = strip.color(value[i]!);
      context.fillRect(left, y, Math.max(0.6, sheet.x(to[i]!, day) - left), tall);
    }
    if (height < LEAST_WITH_VIEW) return; // the bar at the end of the row tells it
    context.fillStyle = colors.value.viewEdge;
    const { seen } = strip;
    for (let i = firstAtLeast(seen.to, begin + 1); i < seen.from.length && seen.from[i]! < end; i++) {
      const left = sheet.x(seen.from[i]!, day);
      context.fillRect(left, y + tall - 1, Math.max(1, sheet.x(seen.to[i]!, day) - left), 1.4);
    }
  });
}

/** Of more people than there are strips for: how many do what, from the first kind at the top to the last. */
function drawCrowdDay(context: Context, crowd: Crowd, sheet: Sheet, day: number): void {
  const wide = sheet.wide / CELLS_A_DAY;
  for (let cell = 0; cell < CELLS_A_DAY; cell++) {
    const counts = crowd.countsAt(day, cell);
    let y = sheet.top(day);
    counts.forEach((count, kind) => {
      const tall = (count / crowd.people) * sheet.tall;
      if (tall === 0) return;
      context.fillStyle = crowd.kinds[kind]![1];
      context.fillRect(LEFT + cell * wide, y, wide + 0.3, tall);
      y += tall;
    });
  }
}

/** How long robots had people in view on a day. */
function drawInView(context: Context, clock: Clock, strips: readonly Strip[], sheet: Sheet, day: number): void {
  const begin = clock.dayStart(day);
  const end = clock.dayStart(day + 1);
  const middle = sheet.top(day) + sheet.tall / 2;
  const hours = strips.reduce((sum, strip) => sum + timeWithin(strip.seen, begin, end), 0) / 3600e6;
  const start = sheet.width - RIGHT + 12;
  context.fillStyle = colors.value.hatch;
  context.fillRect(start, middle - 2.5, BAR, 5);
  context.fillStyle = colors.value.viewEdge;
  context.fillRect(start, middle - 2.5, BAR * Math.min(1, hours / (MOST_IN_VIEW_H * Math.max(1, strips.length))), 5);
  context.fillStyle = colors.value.quiet;
  context.font = `500 ${Math.min(11.5, sheet.rowHeight)}px system-ui, sans-serif`;
  context.textAlign = "right";
  context.fillText(`${hours.toFixed(1)} h`, sheet.width - 8, middle);
}

/** Stretches in which an expectation was violated are framed in red, and answers to a question in the cursor's colour. */
function drawFrames(context: Context, run: Run, sheet: Sheet): void {
  const { clock, facts } = run;
  context.lineWidth = 1.6;
  context.strokeStyle = colors.value.alarm;
  for (const mark of facts.marks) if (mark.kind === "violated") drawFrame(context, clock, sheet, mark.step * clock.stepUs, mark.end * clock.stepUs);
  context.strokeStyle = colors.value.cursor;
  for (const { from, to } of state.answer.value?.spans ?? []) drawFrame(context, clock, sheet, from, to);
}

function drawFrame(context: Context, clock: Clock, sheet: Sheet, from: number, to: number): void {
  for (let day = clock.day(from); day <= clock.day(Math.max(from, to - 1)); day++) {
    const left = sheet.x(from, day);
    context.strokeRect(left, sheet.top(day) - 1, Math.max(3, sheet.x(to, day) - left), sheet.tall + 2);
  }
}
