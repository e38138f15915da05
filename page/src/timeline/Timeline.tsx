/** The timeline: rows that fold, scroll and are zoomed, and a cursor at the moment. */

import { computed, effect, useSignal, type ReadonlySignal } from "@preact/signals";
import { useEffect, useMemo, useRef } from "preact/hooks";
import { durationText } from "../data/clock";
import type { Run } from "../data/run";
import { timeByWord } from "../data/stretches";
import { fitted, oncePerFrame, sizeOf, watchSizes } from "../plan/canvas";
import * as state from "../state";
import { colors } from "../theme";
import { momentSlider } from "../Transport";
import { drawMarked, drawRows, heightOf, type PlacedRow, visibleRows, xOf } from "./draw";
import { type Hovered, Hover } from "./Hover";
import { answerLane, beliefLanes, type Lane, lanesOf, noteLane, tableLanes } from "./lanes";
import { followPointer, scaleOf } from "./pointer";
import * as shown from "./rows";

/** The lanes of a live run are made anew at most this often [ms]. */
const LIVE_MS = 250;

/** Lanes of all runs; those of tables are read once. */
function useLanes(): ReadonlySignal<Lane[]> {
  const lanes = useSignal<Lane[]>([]);
  const extra = useSignal<Map<Run, Lane[]>>(new Map());
  useEffect(() => {
    for (const [i, run] of state.runs.value.entries()) {
      void tableLanes(run, `${i}:`).then((more) => {
        extra.value = new Map(extra.value).set(run, more);
      });
    }
  }, [state.runs.value]);
  useEffect(() => {
    let [timer, last]: [ReturnType<typeof setTimeout> | undefined, number] = [undefined, 0];
    const make = (): void => {
      last = performance.now();
      const runs = state.runs.value;
      const answer = state.answer.value;
      const showsBeliefs = state.panel.value === "beliefs" || state.shown.value.has("beliefs");
      const own = runs.flatMap((run, i) => {
        const other = i === 1 ? runs[0]! : null;
        const title = runs.length > 1 ? run.facts.title : "";
        return [...lanesOf(run, `${i}:`, other, title), ...(extra.value.get(run) ?? [])];
      });
      const believed = showsBeliefs ? runs.flatMap((run, i) => beliefLanes(run, `${i}:`, runs.length > 1 ? run.facts.title : "")) : [];
      const asked = answer && answer.spans.length > 0 ? [answerLane(answer)] : [];
      lanes.value = [...asked, ...(runs[0] ? noteLane(runs[0]) : []), ...believed, ...own];
    };
    const stop = effect(() => {
      void [colors.value, state.answer.value, extra.value, state.panel.value, state.shown.value, state.belief.value];
      for (const run of state.runs.value) void [run.version.value, run.notes.value];
      clearTimeout(timer);
      const wait = state.live.value ? last + LIVE_MS - performance.now() : 0;
      if (wait > 0) timer = setTimeout(make, wait);
      else make();
    });
    return () => {
      clearTimeout(timer);
      stop();
    };
  }, []);
  return lanes;
}

export function Timeline() {
  const scroller = useRef<HTMLElement>(null);
  const box = useRef<HTMLDivElement>(null);
  const base = useRef<HTMLCanvasElement>(null);
  const cursor = useRef<HTMLSpanElement>(null);
  const view = useSignal({ scrolled: 0, height: 0 });
  const hover = useSignal<Hovered | null>(null);
  const lanes = useLanes();
  const rows = useMemo(() => computed(() => shown.rowsOf(lanes.value)), []);
  const visible = useMemo(() => computed(() => visibleRows(rows.value, view.value.scrolled, view.value.height)), []);
  const clock = state.run.value!.clock;
  useEffect(() => {
    const [drawn, line, around] = [base.current!, cursor.current!, scroller.current!];
    const paintRows = oncePerFrame(() => {
      const { context, width, height } = fitted(drawn);
      context.clearRect(0, 0, width, height);
      drawRows(context, visible.value, scaleOf(width), clock, colors.value, height);
      if (state.marked.value) drawMarked(context, scaleOf(width), state.marked.value, height, colors.value);
    });
    const moveCursor = (): void => {
      const [width] = sizeOf(drawn);
      const x = xOf(scaleOf(width), state.moment.value);
      line.style.transform = `translateX(${x.toFixed(1)}px)`;
      line.dataset.side = x < 30 ? "right" : x > width - 30 ? "left" : "";
      line.hidden = x < -1 || x > width + 1;
    };
    const measure = (): void => {
      const { scrollTop: scrolled, clientHeight: height } = around;
      if (scrolled !== view.value.scrolled || height !== view.value.height) view.value = { scrolled, height };
      paintRows();
      moveCursor();
    };
    const stops = [
      effect(() => {
        void [state.range.value, state.marked.value, visible.value, colors.value, state.endUs.value];
        paintRows();
      }),
      effect(moveCursor),
      followPointer({
        box: box.current!,
        rows: () => visible.value,
        hover: (row, us, x, y) => {
          const words = row?.lane?.words(us);
          hover.value = words ? { words: `${row!.label}: ${words} · ${clock.text(us)}`, us, x, y } : null;
        },
      }),
    ];
    const unwatch = watchSizes([box.current!, drawn, around], measure);
    around.addEventListener("scroll", measure, { passive: true });
    return () => {
      unwatch();
      around.removeEventListener("scroll", measure);
      stops.forEach((stop) => stop());
    };
  }, []);
  return (
    <>
      <Totals lanes={lanes} />
      <section ref={scroller} class="timeline" aria-label="Timeline" style={{ "--lanes": `${heightOf(rows.value)}px` }}>
        <div
          ref={box}
          class="lanes"
          {...momentSlider("Moment")}
        >
          <canvas ref={base} aria-hidden="true" />
          <span ref={cursor} class="cursor" aria-hidden="true">
            <CursorTime />
          </span>
        </div>
        <div class="labels">
          <div class="corner">
            <Filter lanes={lanes} />
          </div>
          {visible.value.map((row) => (
            <Label key={row.key} row={row} />
          ))}
        </div>
        <div class="spacer" />
      </section>
      <Hover run={state.run.value!} at={hover.value} />
    </>
  );
}

function CursorTime() {
  return <b>{state.run.value!.clock.timeText(state.told.value)}</b>;
}

function Label({ row }: { row: PlacedRow }) {
  const { lane, folds } = row;
  const style = { top: `${row.top}px`, height: `${row.height}px`, paddingLeft: `${0.4 + 0.6 * row.indent}rem` };
  const isPinned = lane !== null && shown.pinned.value.has(lane.id);
  return (
    <div class={`label${lane ? "" : " group-label"}${row.isPinned ? " pinned" : ""}${row.indent > 1 ? " nested" : ""}`} style={style}>
      {folds && (
        <button
          type="button"
          class="fold"
          aria-expanded={folds === "open"}
          aria-label={lane ? `Lanes of ${row.label}` : row.label}
          onClick={() => shown.change(shown.toggled, row.key)}
        >
          {folds === "open" ? "▾" : "▸"}
        </button>
      )}
      <button type="button" class="name" title={row.label} onClick={() => (lane ? lane.subject && state.select(lane.subject) : shown.change(shown.toggled, row.key))}>
        {row.label}
      </button>
      {lane && (
        <span class="tools">
          <button type="button" aria-pressed={isPinned} aria-label={`Pin ${row.label}`} title="Keep at the top" onClick={() => shown.change(shown.pinned, lane.id)}>
            {isPinned ? "●" : "○"}
          </button>
          <button type="button" aria-label={`Hide ${row.label}`} title="Hide" onClick={() => shown.change(shown.hidden, lane.id)}>
            ×
          </button>
        </span>
      )}
    </div>
  );
}

function Filter({ lanes }: { lanes: ReadonlySignal<Lane[]> }) {
  const count = lanes.value.filter((lane) => shown.hidden.value.has(lane.id)).length;
  return (
    <>
      <input
        type="search"
        id="filter"
        aria-label="Filter the lanes of the timeline"
        placeholder="lanes with …"
        value={shown.filter.value}
        onInput={(event) => {
          shown.filter.value = event.currentTarget.value;
        }}
      />
      {count > 0 && (
        <button
          type="button"
          class="unhide"
          onClick={() => {
            shown.hidden.value = new Set();
          }}
        >
          show {count} hidden
        </button>
      )}
    </>
  );
}

/** What each lane of rooms and activities holds within the marked range. */
function Totals({ lanes }: { lanes: ReadonlySignal<Lane[]> }) {
  const marked = state.marked.value;
  if (!marked || marked[0] === marked[1]) return null;
  const [from, to] = [Math.min(...marked), Math.max(...marked)];
  const clock = state.run.value!.clock;
  const selected = state.selected.value;
  const ofLanes = lanes.value
    .filter((lane) => (selected ? lane.subject === selected : lane.isMain))
    .slice(0, 12)
    .map((lane) => [lane.label, totalsOf(lane, from, to)] as const)
    .filter(([, words]) => words);
  return (
    <section class="totals" aria-label="Totals of the marked range">
      <strong>
        {clock.text(from)} to {clock.text(to)}, {durationText(to - from)}
      </strong>
      <button type="button" aria-label="Close the totals" onClick={() => (state.marked.value = null)}>
        ×
      </button>
      <dl>
        {ofLanes.map(([label, words]) => (
          <div key={label}>
            <dt>{label}</dt>
            <dd>{words}</dd>
          </div>
        ))}
      </dl>
    </section>
  );
}

function totalsOf(lane: Lane, from: number, to: number): string {
  const paint = lane.paint();
  if (paint.kind === "ticks") {
    const count = paint.us.filter((us) => us >= from && us < to).length;
    return count > 0 ? `${count} times` : "";
  }
  if (paint.kind !== "stretches") return "";
  const time = timeByWord(paint.stretches, paint.label, from, to);
  return [...time]
    .sort((a, b) => b[1] - a[1])
    .slice(0, 8)
    .map(([word, us]) => `${word.replaceAll("_", " ")}: ${durationText(us)}`)
    .join(", ");
}
