/** The timeline: lanes that are zoomed and scrubbed, and a cursor at the moment. */

import { effect, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import { fitted, oncePerFrame } from "../plan/canvas";
import * as state from "../state";
import { colors } from "../theme";
import { AXIS_HEIGHT, drawCursor, drawLanes, GAP, heightOf, laneAt, type Scale, usOf, xOf } from "./draw";
import { answerLane, beliefLanes, type Lane, lanesOf, tableLanes } from "./lanes";

/** Lanes of all runs; those of tables are read once. */
function useLanes(): { value: Lane[] } {
  const lanes = useSignal<Lane[]>([]);
  const extra = useSignal<Map<Run, Lane[]>>(new Map());
  useEffect(() => {
    for (const [i, run] of state.runs.value.entries()) {
      void tableLanes(run, `${i}:`).then((more) => {
        extra.value = new Map(extra.value).set(run, more);
      });
    }
  }, [state.runs.value]);
  useEffect(
    () =>
      effect(() => {
        void colors.value;
        const runs = state.runs.value;
        const answer = state.answer.value;
        const own = runs.flatMap((run, i) => {
          void run.version.value;
          const other = runs.length === 2 ? runs[1 - i]! : null;
          if (other) void other.version.value;
          const title = runs.length > 1 ? run.facts.title : "";
          return [...lanesOf(run, `${i}:`, i === 0 ? other : null, title), ...(extra.value.get(run) ?? [])];
        });
        const asked = answer && answer.spans.length > 0 ? [answerLane(answer)] : [];
        const showsBeliefs = state.panel.value === "beliefs" || state.shown.value.has("beliefs");
        lanes.value = [...asked, ...(showsBeliefs && runs[0] ? beliefLanes(runs[0]) : []), ...own];
      }),
    [],
  );
  return lanes;
}

export function Timeline() {
  const box = useRef<HTMLDivElement>(null);
  const base = useRef<HTMLCanvasElement>(null);
  const top = useRef<HTMLCanvasElement>(null);
  const words = useSignal("");
  const lanes = useLanes();
  const clock = state.run.value!.clock;
  useEffect(() => {
    const paintLanes = oncePerFrame(() => {
      const { context, width, height } = fitted(base.current!);
      context.clearRect(0, 0, width, height);
      drawLanes(context, lanes.value, scaleOf(width), clock, colors.value);
    });
    const paintCursor = oncePerFrame(() => {
      const { context, width, height } = fitted(top.current!);
      context.clearRect(0, 0, width, height);
      const x = xOf(scaleOf(width), state.moment.value);
      drawCursor(context, x, height, clock.timeText(state.moment.value), width, colors.value);
    });
    const stops = [
      effect(() => {
        void [state.range.value, lanes.value, colors.value, state.endUs.value];
        paintLanes();
      }),
      effect(() => {
        void [state.range.value, state.moment.value, lanes.value, colors.value];
        paintCursor();
      }),
      followPointer(box.current!, () => lanes.value, words),
    ];
    const observer = new ResizeObserver(() => {
      paintLanes();
      paintCursor();
    });
    observer.observe(box.current!);
    return () => {
      observer.disconnect();
      stops.forEach((stop) => stop());
    };
  }, []);
  const height = heightOf(lanes.value);
  return (
    <section class="timeline" aria-label="Timeline">
      <div class="labels" style={{ paddingTop: `${AXIS_HEIGHT}px` }}>
        {lanes.value.map((lane) => (
          <button
            key={lane.id}
            type="button"
            title={lane.label}
            style={{ height: `${lane.height}px`, marginBottom: `${GAP}px` }}
            onClick={() => lane.subject && state.select(lane.subject)}
          >
            {lane.label}
          </button>
        ))}
      </div>
      <div
        ref={box}
        class="lanes"
        role="slider"
        tabIndex={0}
        aria-label="Moment"
        aria-valuemin={0}
        aria-valuemax={clock.steps - 1}
        aria-valuenow={clock.stepAt(state.moment.value)}
        aria-valuetext={clock.text(state.moment.value)}
        style={{ height: `${height}px` }}
      >
        <canvas ref={base} aria-hidden="true" />
        <canvas ref={top} aria-hidden="true" />
      </div>
      <output class="hover" aria-live="off">{words.value}</output>
    </section>
  );
}

function scaleOf(width: number): Scale {
  const [from, to] = state.range.value;
  return { from, to, width };
}

function followPointer(box: HTMLElement, lanes: () => Lane[], words: { value: string }): () => void {
  let mode: "scrub" | "pan" | null = null;
  let lastX = 0;
  const us = (event: MouseEvent): number => usOf(scaleOf(box.clientWidth), event.clientX - box.getBoundingClientRect().left);
  const down = (event: PointerEvent): void => {
    box.setPointerCapture(event.pointerId);
    mode = event.shiftKey || event.button === 1 ? "pan" : "scrub";
    lastX = event.clientX;
    state.follow.value = false;
    if (mode === "scrub") state.goTo(us(event));
  };
  const move = (event: PointerEvent): void => {
    if (mode === "scrub") state.goTo(us(event));
    else if (mode === "pan") {
      const [from, to] = state.range.value;
      state.pan(((lastX - event.clientX) / box.clientWidth) * (to - from));
      lastX = event.clientX;
    }
    const lane = laneAt(lanes(), event.clientY - box.getBoundingClientRect().top);
    const word = lane?.words(us(event)) ?? "";
    words.value = word ? `${lane!.label}: ${word}` : "";
  };
  const up = (): void => {
    mode = null;
  };
  const wheel = (event: WheelEvent): void => {
    if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
      const [from, to] = state.range.value;
      state.pan(((event.deltaX || event.deltaY) / box.clientWidth) * (to - from));
    } else {
      const scroller = box.parentElement!;
      const onAxis = event.clientY - box.getBoundingClientRect().top < AXIS_HEIGHT;
      const scrolls = scroller.scrollHeight > scroller.clientHeight + 1;
      if (scrolls && !onAxis && !event.ctrlKey && !event.metaKey) return;
      state.zoom(Math.exp(event.deltaY * 0.0018), us(event));
    }
    event.preventDefault();
  };
  const showWholeRun = (): void => state.setRange(state.beginUs.value, state.endUs.value);
  box.addEventListener("pointerdown", down);
  box.addEventListener("pointermove", move);
  box.addEventListener("pointerup", up);
  box.addEventListener("wheel", wheel, { passive: false });
  box.addEventListener("dblclick", showWholeRun);
  return () => {
    box.removeEventListener("pointerdown", down);
    box.removeEventListener("pointermove", move);
    box.removeEventListener("pointerup", up);
    box.removeEventListener("wheel", wheel);
    box.removeEventListener("dblclick", showWholeRun);
  };
}
