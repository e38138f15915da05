/** The plan of a run at the moment: the home in its light, and above it people, robots and layers. */

import { effect, untracked, useSignal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import { Icon } from "../Icon";
import { feedOf } from "../live/feed";
import { askCall, askPlace, branchHere, branching, calling, closeRun, placing } from "../live/orders";
import { Changes } from "../panels/Differences";
import * as state from "../state";
import { colors } from "../theme";
import { oncePerFrame, watchSizes } from "./canvas";
import { PlanPainter } from "./painter";

const READ_MS = 120;
/** The home keeps this far from the clock [px]. */
const CLEAR_PX = 10;

interface Pointer {
  x: number;
  y: number;
  moved: boolean;
  body: string;
}

export function Plan({ run, other, title }: { run: Run; other: Run | null; title: string }) {
  const base = useRef<HTMLCanvasElement>(null);
  const top = useRef<HTMLCanvasElement>(null);
  const hover = useSignal<{ words: string; x: number; y: number } | null>(null);
  const isWhole = useSignal(true);
  const fit = useRef(() => {});
  useEffect(() => {
    const canvases = [base.current!, top.current!] as const;
    const painter = new PlanPainter(...canvases, run, other);
    const repaint = oncePerFrame(() => {
      painter.paint();
      isWhole.value = painter.isWhole;
    });
    fit.current = () => {
      state.followed.value = "";
      painter.showWhole();
      repaint();
    };
    const stopPainting = effect(() => {
      void [run.version.value, state.moment.value, state.shown.value, state.selected.value];
      void [state.layer.value, state.belief.value, state.followed.value, colors.value, other?.version.value];
      repaint();
    });
    const stopFitting = effect(() => {
      if (state.fits.value > 0) untracked(() => fit.current());
    });
    const stopReading = readAtMoment(run, painter, repaint);
    const unwatch = watchSizes(canvases, () => {
      painter.corner = cornerOf(canvases[1]);
      repaint();
    });
    const stopPointing = followPointer(canvases[1], run, painter, repaint, fit.current, hover);
    return () => {
      stopPainting();
      stopFitting();
      stopReading();
      stopPointing();
      unwatch();
    };
  }, [run, other]);
  return (
    <figure class="plan">
      <canvas ref={base} aria-hidden="true" />
      <canvas ref={top} class="top" role="img" aria-label={`Floor plan of ${run.facts.home.name}, ${title}`} />
      {hover.value && (
        <output class="hover" aria-live="off" style={{ left: `${hover.value.x}px`, top: `${hover.value.y}px` }} data-side={hover.value.x > 400 ? "left" : "right"}>
          {hover.value.words}
        </output>
      )}
      {!isWhole.value && (
        <button type="button" class="fit" title="The whole home again (double click)" onClick={() => fit.current()}>
          <Icon name="fit" /> Fit
        </button>
      )}
      {title && (
        <figcaption>
          {title} <Changes run={run} />
          {run.path && (
            <button type="button" disabled={branching.value} onClick={() => void branchHere(run)}>
              Continue from here
            </button>
          )}
          <button type="button" aria-label={`Close ${title}`} onClick={() => closeRun(run)}>
            ×
          </button>
        </figcaption>
      )}
    </figure>
  );
}

/** The corner of a plan that the clock takes [px]. */
function cornerOf(canvas: HTMLCanvasElement): readonly [number, number] {
  const clock = document.querySelector(".clock");
  const plans = canvas.closest(".plans");
  if (!clock || !plans || getComputedStyle(clock).position !== "absolute") return [0, 0];
  // Plans beside each other keep the same corner free, so that both homes are of one size.
  const [box, plan] = [clock.getBoundingClientRect(), plans.getBoundingClientRect()];
  return [box.right - plan.left + CLEAR_PX, box.bottom - plan.top + CLEAR_PX];
}

/** Read the observations and the layer of the moment, several times a second while it changes. */
function readAtMoment(run: Run, painter: PlanPainter, repaint: () => void): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let last = "";
  const wanted = (): string => `${state.layer.value}@${run.clock.stepAt(state.moment.value)}${run.observations ? "" : " alone"}`;
  const readNext = (): void => {
    if (wanted() === last || timer !== undefined) return;
    timer = setTimeout(() => {
      last = wanted();
      const { observations } = run;
      const step = run.clock.stepAt(state.moment.value);
      const isMissing = observations?.at(step) === null;
      const read = run.attempt(async () => {
        await Promise.all([observations?.load(step), painter.loadLayer(state.layer.value, step)]);
        repaint();
        if (isMissing) run.changed();
      });
      void read.then(() => {
        timer = undefined;
        untracked(readNext); // the moment may have changed meanwhile
      });
    }, READ_MS);
  };
  const stop = effect(() => {
    void run.version.value;
    readNext();
  });
  return () => {
    stop();
    clearTimeout(timer);
  };
}

function followPointer(
  canvas: HTMLCanvasElement,
  run: Run,
  painter: PlanPainter,
  repaint: () => void,
  showWhole: () => void,
  hover: { value: { words: string; x: number; y: number } | null },
): () => void {
  let held: Pointer | null = null;
  /** Fingers on the plan, by their pointers: two of them zoom. */
  const fingers = new Map<number, [number, number]>();
  const at = (event: PointerEvent | WheelEvent): [number, number] => [event.offsetX, event.offsetY];
  const down = (event: PointerEvent): void => {
    const [x, y] = at(event);
    if (event.pointerType === "touch") fingers.set(event.pointerId, [x, y]);
    hover.value = null;
    held = { x, y, moved: false, body: feedOf(run) ? painter.bodyAt(x, y) : "" };
    canvas.setPointerCapture(event.pointerId);
  };
  const move = (event: PointerEvent): void => {
    const [x, y] = at(event);
    const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
    if (other && fingers.has(event.pointerId)) {
      const before = fingers.get(event.pointerId)!;
      const far = Math.hypot(x - other[0], y - other[1]);
      zoomAbout((x + other[0]) / 2, (y + other[1]) / 2, far / Math.hypot(before[0] - other[0], before[1] - other[1]));
      fingers.set(event.pointerId, [x, y]);
      held = null;
      return;
    }
    if (!held) {
      const words = painter.wordsAt(x, y);
      hover.value = words ? { words, x, y } : null;
      return;
    }
    if (!held.moved && Math.hypot(x - held.x, y - held.y) < 4) return;
    held.moved = true;
    if (held.body) return;
    state.followed.value = "";
    painter.pan(x - held.x, y - held.y);
    [held.x, held.y] = [x, y];
    repaint();
  };
  const up = (event: PointerEvent): void => {
    const [x, y] = at(event);
    fingers.delete(event.pointerId);
    const place = painter.placeAt(x, y);
    if (held?.moved && held.body && place) void askPlace(run, held.body, ...place);
    else if (held && !held.moved && calling.value && place) void askCall(run, calling.value, ...place);
    else if (held && !held.moved && placing.value && place) void askPlace(run, placing.value, ...place);
    else if (held && !held.moved) state.select(painter.thingAt(x, y), run);
    held = null;
  };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    zoomAbout(event.offsetX, event.offsetY, Math.exp(-event.deltaY * 0.0015));
  };
  const zoomAbout = (px: number, py: number, factor: number): void => {
    painter.zoomAbout(px, py, factor);
    repaint();
  };
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("wheel", wheel, { passive: false });
  const leave = (): void => {
    hover.value = null;
  };
  canvas.addEventListener("pointerleave", leave);
  canvas.addEventListener("dblclick", showWhole);
  return () => {
    canvas.removeEventListener("pointerdown", down);
    canvas.removeEventListener("pointermove", move);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("wheel", wheel);
    canvas.removeEventListener("pointerleave", leave);
    canvas.removeEventListener("dblclick", showWhole);
  };
}
