/** The run as a calendar: a row for each day, in it a strip for each person. */

import { computed, effect, signal, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import { firstAtLeast } from "../data/search";
import { valueAt } from "../data/stretches";
import { title } from "../data/words";
import { fitted, oncePerFrame } from "../plan/canvas";
import * as state from "../state";
import { colors } from "../theme";
import { type Strip, stripsOf, timeWithin } from "./days";

const HEAD = 22;
const LEFT = 96;
const RIGHT = 118;
const NARROW_RIGHT = 8;
const GAP = 2;
/** Heights of a row [px]. */
const LEAST_ROW = 10;
const MOST_ROW = 24;
const MOST_STRIPS = 8;
const HOURS = [0, 3, 6, 9, 12, 15, 18, 21, 24];

interface Sheet {
  width: number;
  height: number;
  scrolled: number;
  rowHeight: number;
  right: number;
}

/** Whose strips are shown; empty: everybody's. */
const chosen = signal("");

/** The people of a run in the calendar, as far as it is read. */
const strips = computed<readonly Strip[]>(() => {
  const run = state.run.value;
  if (!run) return [];
  void [run.version.value, colors.value];
  return stripsOf(run).slice(0, MOST_STRIPS);
});
const shown = computed(() => strips.value.filter((strip) => !chosen.value || strip.name === chosen.value));

/** Who is in the calendar, and what its colours stand for. */
export function CalendarHead() {
  return (
    <>
      <div class="segments" role="group" aria-label="People in the calendar">
        {["", ...strips.value.map((strip) => strip.name)].map((name) => (
          <button key={name} type="button" aria-pressed={chosen.value === name} onClick={() => (chosen.value = name)}>
            {name ? title(name) : "All"}
          </button>
        ))}
      </div>
      <ul class="legend-row">
        {[...new Map(shown.value.flatMap((strip) => strip.legend))].map(([words, color]) => (
          <li key={words}>
            <span class="swatch" style={{ background: color }} /> {words}
          </li>
        ))}
        {shown.value.some((strip) => strip.seen.from.length > 0) && (
          <li>
            <span class="swatch seen" /> In view
          </li>
        )}
      </ul>
    </>
  );
}

export function Calendar() {
  return (
    <section class="calendar" aria-label="Calendar">
      <Days run={state.run.value!} />
    </section>
  );
}

function Days({ run }: { run: Run }) {
  const scroller = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const overlay = useRef<HTMLCanvasElement>(null);
  const hover = useSignal<{ words: string; x: number; y: number } | null>(null);
  const { clock } = run;
  const firstDay = clock.day(run.beginUs);
  const days = clock.day(Math.max(run.beginUs, run.endUs - 1)) - firstDay + 1;
  const room = useSignal(0);
  // All days are seen at once where they fit; else one scrolls.
  const rowHeight = Math.max(LEAST_ROW, Math.min(MOST_ROW, Math.floor((room.value - HEAD - 4) / days)));
  const sheetOf = (element: HTMLCanvasElement): { context: CanvasRenderingContext2D; sheet: Sheet } => {
    const { context, width, height } = fitted(element);
    context.clearRect(0, 0, width, height);
    const right = width < 700 ? NARROW_RIGHT : RIGHT;
    return { context, sheet: { width, height, scrolled: scroller.current!.scrollTop, rowHeight, right } };
  };
  const dayTop = (sheet: Sheet, i: number): number => HEAD + i * sheet.rowHeight - sheet.scrolled;
  const at = (sheet: Sheet, x: number, y: number): { us: number; day: number; strip: Strip | undefined } | null => {
    const i = Math.floor((y - HEAD + sheet.scrolled) / sheet.rowHeight);
    if (y < HEAD || i < 0 || i >= days) return null;
    const share = Math.max(0, Math.min(0.99999, (x - LEFT) / (sheet.width - LEFT - sheet.right)));
    const inRow = (y - dayTop(sheet, i)) / (sheet.rowHeight - GAP);
    const strip = shown.value[Math.min(shown.value.length - 1, Math.floor(inRow * shown.value.length))];
    return { us: clock.ofShare(share, firstDay + i), day: firstDay + i, strip };
  };
  useEffect(() => {
    const paint = oncePerFrame(() => {
      const { context, sheet } = sheetOf(canvas.current!);
      drawHours(context, sheet);
      const from = Math.max(0, Math.floor(sheet.scrolled / rowHeight));
      const to = Math.min(days, from + Math.ceil(sheet.height / rowHeight) + 1);
      for (let i = from; i < to; i++) drawDay(context, run, shown.value, sheet, dayTop(sheet, i), firstDay + i);
      drawFrames(context, run, sheet, (day) => dayTop(sheet, day - firstDay));
      context.clearRect(0, 0, sheet.width, HEAD - 2);
      drawHours(context, sheet);
    });
    const paintCursor = oncePerFrame(() => {
      const { context, sheet } = sheetOf(overlay.current!);
      const us = state.moment.value;
      const day = clock.day(us);
      const top = dayTop(sheet, day - firstDay);
      if (top < HEAD - rowHeight) return;
      const x = LEFT + clock.share(us, day) * (sheet.width - LEFT - sheet.right);
      context.strokeStyle = colors.value.text;
      context.lineWidth = 1.5;
      context.strokeRect(LEFT - 1, top - 1, sheet.width - LEFT - sheet.right + 2, rowHeight - GAP + 2);
      context.fillStyle = colors.value.cursor;
      context.fillRect(x - 1, top - 4, 2, rowHeight - GAP + 8);
      context.beginPath();
      context.arc(x, top - 4, 4, 0, 2 * Math.PI);
      context.fill();
    });
    const stops = [
      effect(() => {
        void [shown.value, colors.value, run.version.value, state.answer.value];
        paint();
      }),
      effect(() => {
        void [state.moment.value, shown.value, colors.value];
        paintCursor();
      }),
    ];
    const both = (): void => {
      room.value = scroller.current!.clientHeight;
      paint();
      paintCursor();
    };
    const observer = new ResizeObserver(both);
    observer.observe(scroller.current!);
    scroller.current!.addEventListener("scroll", both, { passive: true });
    return () => {
      observer.disconnect();
      scroller.current?.removeEventListener("scroll", both);
      stops.forEach((stop) => stop());
    };
  }, [run, rowHeight, days]);
  const point = (event: PointerEvent): ReturnType<typeof at> => {
    const box = canvas.current!.getBoundingClientRect();
    const sheet = { width: box.width, height: box.height, scrolled: scroller.current!.scrollTop, rowHeight, right: box.width < 700 ? NARROW_RIGHT : RIGHT };
    return at(sheet, event.clientX - box.left, event.clientY - box.top);
  };
  const move = (event: PointerEvent): void => {
    const found = point(event);
    if (event.buttons === 1 && found) state.goTo(found.us);
    if (!found || event.buttons) {
      hover.value = null;
      return;
    }
    const box = scroller.current!.getBoundingClientRect();
    const value = found.strip && valueAt(found.strip.stretches, found.us);
    const does = found.strip && value !== null && value !== undefined ? `${title(found.strip.name)}: ${found.strip.words(value)} · ` : "";
    hover.value = { words: `${does}${clock.dateText(found.us)} ${clock.timeText(found.us, false)}`, x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const press = (event: PointerEvent): void => {
    const found = point(event);
    if (found) state.goTo(found.us);
  };
  return (
    <div class="calendar-box">
      <div ref={scroller} class="days" onPointerMove={move} onPointerDown={press} onPointerLeave={() => (hover.value = null)}>
        <div class="sheet">
          <canvas ref={canvas} role="img" aria-label={`What people did on each of ${days} days`} />
          <canvas ref={overlay} aria-hidden="true" />
        </div>
        <div class="filler" style={{ height: `${HEAD + days * rowHeight + 4}px` }} />
      </div>
      {hover.value && (
        <output class="hover" aria-live="off" style={{ left: `${hover.value.x}px`, top: `${hover.value.y}px` }} data-side={hover.value.x > 500 ? "left" : "right"}>
          {hover.value.words}
        </output>
      )}
    </div>
  );
}

function drawHours(context: CanvasRenderingContext2D, sheet: Sheet): void {
  context.font = "500 11px system-ui, sans-serif";
  context.textBaseline = "middle";
  context.fillStyle = colors.value.quiet;
  context.textAlign = "center";
  for (const hour of HOURS) {
    const x = LEFT + (hour / 24) * (sheet.width - LEFT - sheet.right);
    context.fillText(String(hour).padStart(2, "0"), x, HEAD / 2);
  }
  if (sheet.right === RIGHT) {
    context.textAlign = "left";
    context.fillText("In view", sheet.width - RIGHT + 12, HEAD / 2);
  }
}

/** A day: its date, a strip for each person, and how long robots had people in view. */
function drawDay(context: CanvasRenderingContext2D, run: Run, strips: readonly Strip[], sheet: Sheet, top: number, day: number): void {
  const { clock } = run;
  const begin = clock.dayStart(day);
  const end = clock.dayStart(day + 1);
  const tall = sheet.rowHeight - GAP;
  const wide = sheet.width - LEFT - sheet.right;
  const x = (us: number): number => LEFT + (us < end ? clock.share(us, day) : 1) * wide;
  const date = clock.dateText(begin);
  const isWeekend = /^S[au]/.test(date);
  const size = Math.min(11.5, sheet.rowHeight);
  context.font = `${isWeekend ? 600 : 400} ${size}px system-ui, sans-serif`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  context.fillStyle = isWeekend ? colors.value.text : colors.value.quiet;
  context.fillText(date, 12, top + tall / 2);
  const height = tall / Math.max(1, strips.length);
  strips.forEach((strip, k) => {
    const y = top + k * height;
    const { from, to, value } = strip.stretches;
    for (let i = firstAtLeast(to, begin + 1); i < from.length && from[i]! < end; i++) {
      const left = x(Math.max(begin, from[i]!));
      context.fillStyle = strip.color(value[i]!);
      context.fillRect(left, y, Math.max(0.6, x(Math.min(end, to[i]!)) - left), height - 0.6);
    }
    context.fillStyle = colors.value.viewEdge;
    const { seen } = strip;
    for (let i = firstAtLeast(seen.to, begin + 1); i < seen.from.length && seen.from[i]! < end; i++) {
      const left = x(Math.max(begin, seen.from[i]!));
      context.fillRect(left, y + height - 1.6, Math.max(1, x(Math.min(end, seen.to[i]!)) - left), 1.4);
    }
  });
  if (sheet.right !== RIGHT) return;
  const hours = strips.reduce((sum, strip) => sum + timeWithin(strip.seen, begin, end), 0) / 3600e6;
  const start = sheet.width - RIGHT + 12;
  context.fillStyle = colors.value.hatch;
  context.fillRect(start, top + tall / 2 - 2.5, 56, 5);
  context.fillStyle = colors.value.viewEdge;
  context.fillRect(start, top + tall / 2 - 2.5, 56 * Math.min(1, hours / (4 * Math.max(1, strips.length))), 5);
  context.fillStyle = colors.value.quiet;
  context.font = `500 ${size}px system-ui, sans-serif`;
  context.textAlign = "right";
  context.fillText(`${hours.toFixed(1)} h`, sheet.width - 8, top + tall / 2);
}

/** Stretches in which an expectation was violated are framed in red, and answers to a question in the cursor's colour. */
function drawFrames(context: CanvasRenderingContext2D, run: Run, sheet: Sheet, dayTop: (day: number) => number): void {
  const { stepUs } = run.clock;
  const violated = run.facts.marks.filter((mark) => mark.kind === "violated");
  for (const mark of violated) drawFrame(context, run, sheet, dayTop, mark.step * stepUs, mark.end * stepUs, colors.value.alarm);
  for (const { from, to } of state.answer.value?.spans ?? []) drawFrame(context, run, sheet, dayTop, from, to, colors.value.cursor);
}

function drawFrame(context: CanvasRenderingContext2D, run: Run, sheet: Sheet, dayTop: (day: number) => number, from: number, to: number, color: string): void {
  const { clock } = run;
  const wide = sheet.width - LEFT - sheet.right;
  context.strokeStyle = color;
  context.lineWidth = 1.6;
  for (let day = clock.day(from); day <= clock.day(Math.max(from, to - 1)); day++) {
    const left = LEFT + (day > clock.day(from) ? 0 : clock.share(from, day)) * wide;
    const right = LEFT + (to < clock.dayStart(day + 1) ? clock.share(to, day) : 1) * wide;
    context.strokeRect(left, dayTop(day) - 1, Math.max(3, right - left), sheet.rowHeight - GAP + 2);
  }
}
