/** The run as a calendar: a row for each day, in it a strip for each person, or how many of a crowd do what. */

import { computed, effect, signal, untracked, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import { valueAt } from "../data/stretches";
import { fitted, oncePerFrame, sizeOf, watchSizes } from "../plan/canvas";
import * as state from "../state";
import { colors } from "../theme";
import { Crowd } from "./crowd";
import { type Strip, stripsOf } from "./days";
import { type Hovered, Hover } from "./Hover";
import { drawMonth } from "./month";
import { type Days as DayRange, GAP, HEAD, LEFT, roomyHeight, Sheet } from "./sheet";

/** With more people, a row shows how many do what. */
const MOST_STRIPS = 8;

/** Whose strips are shown; empty: everybody's. */
const chosen = signal("");

/** The people of a run in the calendar, as far as it is read. */
const strips = computed<readonly Strip[]>(() => {
  const run = state.run.value;
  if (!run) return [];
  void [run.version.value, colors.value];
  // Rooms would be shown until the activities are read.
  return run.isRead.value ? stripsOf(run) : [];
});
const shown = computed(() => {
  const ofChosen = strips.value.filter((strip) => strip.name === chosen.value);
  return ofChosen.length > 0 ? ofChosen : strips.value;
});

const days = computed<DayRange>(() => {
  const { clock, beginUs, endUs } = state.run.value!;
  const first = clock.day(beginUs);
  return { first, count: clock.day(Math.max(beginUs, endUs - 1)) - first + 1 };
});

/** What a crowd does; null where everybody has a strip. */
const crowd = computed(() => (shown.value.length > MOST_STRIPS ? new Crowd(shown.value, state.run.value!.clock, days.value) : null));

/** For how many strips a row has room. */
const stripCount = computed(() => (crowd.value ? MOST_STRIPS : shown.value.length));

/** Whether robots ever had any of them in view. */
const tellsView = computed(() => shown.value.some((strip) => strip.seen.from.length > 0));

/** Who is in the calendar, and what its colours stand for. */
export function CalendarHead() {
  return (
    <>
      <People />
      <ul class="legend-row">
        {[...new Map(shown.value.flatMap((strip) => strip.legend))].map(([words, color]) => (
          <li key={words}>
            <span class="swatch" style={{ background: color }} /> {words}
          </li>
        ))}
        {!crowd.value && tellsView.value && (
          <li>
            <span class="swatch seen" /> In view
          </li>
        )}
      </ul>
    </>
  );
}

function People() {
  const names = strips.value.map((strip) => strip.name);
  if (names.length < 2) return null;
  if (names.length > MOST_STRIPS) {
    return (
      <select aria-label="People in the calendar" value={chosen.value} onChange={(event) => (chosen.value = event.currentTarget.value)}>
        <option value="">All {names.length} people</option>
        {names.map((name) => (
          <option key={name} value={name}>
            {state.run.value!.label(name)}
          </option>
        ))}
      </select>
    );
  }
  return (
    <div class="segments" role="group" aria-label="People in the calendar">
      {["", ...names].map((name) => (
        <button key={name} type="button" aria-pressed={chosen.value === name} onClick={() => (chosen.value = name)}>
          {name ? state.run.value!.label(name) : "All"}
        </button>
      ))}
    </div>
  );
}

export function Calendar() {
  if (strips.value.length === 0 && state.run.value!.isRead.value) {
    return (
      <section class="calendar" aria-label="Calendar">
        <p class="hint empty">Nobody lives here: the calendar is about people. Robots are in the lanes.</p>
      </section>
    );
  }
  return (
    <section class="calendar" aria-label="Calendar" style={{ "--days": `${roomyHeight(days.value.count, stripCount.value)}px` }}>
      <Days run={state.run.value!} />
    </section>
  );
}

function Days({ run }: { run: Run }) {
  const scroller = useRef<HTMLDivElement>(null);
  const canvas = useRef<HTMLCanvasElement>(null);
  const frame = useRef<HTMLSpanElement>(null);
  const cursor = useRef<HTMLSpanElement>(null);
  const hover = useSignal<Hovered | null>(null);
  const whole = useSignal(0);
  const { clock } = run;
  const sheetOf = (drawn: Element, box: Element): Sheet => {
    const [width] = sizeOf(drawn);
    const [, height] = sizeOf(box);
    return new Sheet(width, height, box.scrollTop, days.value, stripCount.value, tellsView.value, clock);
  };
  useEffect(() => {
    const [drawn, box] = [canvas.current!, scroller.current!];
    const [today, line] = [frame.current!, cursor.current!];
    let sheet = sheetOf(drawn, box);
    const paint = oncePerFrame(() => {
      const { context } = fitted(drawn);
      drawMonth(context, run, shown.value, crowd.value, sheet);
    });
    const moveCursor = (): void => {
      const us = state.moment.value;
      const day = clock.day(us);
      const top = sheet.top(day);
      const isSeen = top >= HEAD - sheet.rowHeight && top < sheet.height;
      today.hidden = !isSeen;
      line.hidden = !isSeen;
      today.style.transform = `translate(${LEFT - 1}px, ${top - 1}px)`;
      today.style.width = `${sheet.wide + 2}px`;
      today.style.height = `${sheet.rowHeight - GAP + 2}px`;
      line.style.height = `${sheet.rowHeight - GAP + 8}px`;
      line.style.transform = `translate(${(sheet.x(us, day) - 1).toFixed(1)}px, ${top - 4}px)`;
    };
    const measure = (): void => {
      sheet = sheetOf(drawn, box);
      whole.value = sheet.whole;
      paint();
      moveCursor();
    };
    const stops = [
      effect(() => {
        void [shown.value, crowd.value, days.value, colors.value, run.version.value, state.answer.value];
        untracked(measure);
      }),
      effect(moveCursor),
      watchSizes([box, drawn], measure),
    ];
    box.addEventListener("scroll", measure, { passive: true });
    return () => {
      box.removeEventListener("scroll", measure);
      stops.forEach((stop) => stop());
    };
  }, [run]);
  const point = (event: PointerEvent): (ReturnType<Sheet["at"]> & { x: number; y: number }) | null => {
    const { left, top } = canvas.current!.getBoundingClientRect();
    const [x, y] = [event.clientX - left, event.clientY - top];
    const found = sheetOf(canvas.current!, scroller.current!).at(x, y);
    return found && { ...found, x: event.clientX, y: event.clientY };
  };
  const move = (event: PointerEvent): void => {
    const found = point(event);
    if (event.buttons === 1 && found) state.goTo(found.us, true);
    hover.value = found && !event.buttons ? { us: found.us, x: found.x, y: found.y, words: wordsAt(found) } : null;
  };
  const wordsAt = ({ us, down }: { us: number; down: number }): string => {
    const when = `${clock.dateText(us)} ${clock.timeText(us, false)}`;
    if (crowd.value) return [crowd.value.words(us), when].filter(Boolean).join(" · ");
    const strip = shown.value[Math.floor(down * shown.value.length)];
    const value = strip ? valueAt(strip.stretches, us) : null;
    return strip && value !== null ? `${run.label(strip.name)}: ${strip.words(value)} · ${when}` : when;
  };
  const press = (event: PointerEvent): void => {
    const found = point(event);
    if (found) state.goTo(found.us);
  };
  return (
    <div class="calendar-box">
      <div ref={scroller} class="days" onPointerMove={move} onPointerDown={press} onPointerLeave={() => (hover.value = null)}>
        <div class="sheet">
          <canvas ref={canvas} role="img" aria-label={`What people did on each of ${days.value.count} days`} />
          <span ref={frame} class="today" aria-hidden="true" />
          <span ref={cursor} class="cursor" aria-hidden="true" />
        </div>
        <div class="filler" style={{ height: `${whole.value}px` }} />
      </div>
      <Hover run={run} at={hover.value} />
    </div>
  );
}
