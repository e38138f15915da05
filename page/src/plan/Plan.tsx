/** The plan of a run at the moment: ground, layers, people, robots. */

import { effect } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import type { Run } from "../data/run";
import type { Layer } from "../data/layers";
import { feedOf } from "../live/feed";
import { askCall, askPlace, branchHere, branching, calling, closeRun, placing } from "../live/orders";
import * as state from "../state";
import { colors, dark, scaleColor } from "../theme";
import { drawBeliefs } from "./beliefs";
import { bodyRadius, drawScene } from "./bodies";
import { fitted, oncePerFrame } from "./canvas";
import { FOOT, Frame } from "./frame";
import { cellImage, drawCells, drawGround, tracePolygons } from "./ground";

interface Pointer {
  x: number;
  y: number;
  moved: boolean;
  body: string;
}

/** Draws one run on a canvas, and finds what is under the pointer. */
class PlanPainter {
  zoom = 1;
  shift: [number, number] = [0, 0];
  private readonly ground = document.createElement("canvas");
  private groundKey = "";
  private layerImage: HTMLCanvasElement | null = null;
  private layerKey = "";
  private frame: Frame | null = null;

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly run: Run,
    private readonly other: Run | null,
  ) {}

  paint(): void {
    const { context, width, height } = fitted(this.canvas);
    if (width === 0 || height === 0) return;
    const frame = Frame.fit(this.run.home, width, height, this.zoom, this.shift);
    this.frame = frame;
    this.paintGround(frame, width, height);
    context.clearRect(0, 0, width, height);
    context.drawImage(this.ground, 0, 0, width, height);
    if (this.layerImage && state.layer.value) this.paintLayer(context, frame);
    if (state.shown.value.has("beliefs")) drawBeliefs(context, this.run, frame, state.moment.value);
    drawScene(context, {
      run: this.run,
      us: state.moment.value,
      frame,
      colors: colors.value,
      selected: state.selected.value,
      shows: (name) => state.shown.value.has(name as state.Switch),
      other: this.other,
    });
  }

  private paintGround(frame: Frame, width: number, height: number): void {
    const [names, furniture] = [state.shown.value.has("names"), state.shown.value.has("furniture")];
    const ratio = window.devicePixelRatio || 1;
    const key = [width, height, ratio, this.zoom, ...this.shift, dark.value, names, furniture].join();
    if (key === this.groundKey) return;
    this.groundKey = key;
    this.ground.width = Math.round(width * ratio);
    this.ground.height = Math.round(height * ratio);
    const context = this.ground.getContext("2d")!;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawGround(context, this.run.home, frame, { colors: colors.value, dark: dark.value, names, furniture });
  }

  private paintLayer(context: CanvasRenderingContext2D, frame: Frame): void {
    context.save();
    tracePolygons(context, frame, this.run.facts.home.free.flat());
    context.clip("evenodd");
    context.globalAlpha = 0.7;
    drawCells(context, this.run.home, frame, this.layerImage!);
    context.restore();
  }

  async loadLayer(name: string, step: number): Promise<void> {
    if (!name) return;
    const table = await this.run.layer(name);
    const layer = await table.at(step);
    const key = `${name}@${layer?.step}`;
    if (!layer || key === this.layerKey) return;
    this.layerKey = key;
    this.layerImage = layerImage(this.run, layer);
  }

  /** The body at a pixel; empty where there is none. */
  bodyAt(px: number, py: number): string {
    const { frame, run } = this;
    if (!frame) return "";
    let [nearest, best] = ["", 12];
    for (const body of run.bodies) {
      const pose = run.tracks.get(body.name)?.poseAt(state.moment.value);
      if (!pose || pose.away) continue;
      const far = Math.hypot(frame.ux(pose.x) - px, frame.uy(pose.y) - py) - bodyRadius(frame, body);
      if (far < best) [nearest, best] = [body.name, far];
    }
    return nearest;
  }

  /** What is at a pixel, as `inspect` names it: a body, a door, or a room. */
  thingAt(px: number, py: number): string {
    const { frame, run } = this;
    if (!frame) return "";
    const body = this.bodyAt(px, py);
    if (body) return body;
    const [x, y] = frame.place(px, py);
    const door = run.facts.home.doors.find((entry) => {
      const [mx, my] = [(entry.start[0] + entry.end[0]) / 2, (entry.start[1] + entry.end[1]) / 2];
      return Math.hypot(mx - x, my - y) * frame.scale < 14;
    });
    if (door) return door.name;
    const room = run.home.roomAt(run.home.units(x, 0), run.home.units(y, 1));
    return room >= 0 ? run.home.roomName(room) : "";
  }

  placeAt(px: number, py: number): [number, number] | null {
    return this.frame?.place(px, py) ?? null;
  }
}

function layerImage(run: Run, layer: Layer): HTMLCanvasElement {
  const width = layer.high - layer.low || 1;
  return cellImage(run.home, (cell) => {
    const value = layer.values[cell]!;
    if (run.home.cells[cell]! < 0 || Number.isNaN(value)) return null;
    if (layer.low >= 0 && layer.high <= 1 && value === 0) return null;
    return [...scaleColor((value - layer.low) / width), 255];
  });
}

export function Plan({ run, other, title }: { run: Run; other: Run | null; title: string }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => {
    const painter = new PlanPainter(canvas.current!, run, other);
    const repaint = oncePerFrame(() => painter.paint());
    const stopPainting = effect(() => {
      void [run.version.value, state.moment.value, state.shown.value, state.selected.value];
      void [state.layer.value, state.belief.value, colors.value, other?.version.value];
      repaint();
    });
    const stopReading = readAtMoment(run, painter, repaint);
    const observer = new ResizeObserver(repaint);
    observer.observe(canvas.current!);
    const stopPointing = followPointer(canvas.current!, run, painter, repaint);
    return () => {
      stopPainting();
      stopReading();
      stopPointing();
      observer.disconnect();
    };
  }, [run, other]);
  return (
    <figure class="plan">
      <canvas ref={canvas} role="img" aria-label={`Floor plan of ${run.facts.home.name}, ${title}`} />
      {title && (
        <figcaption>
          {title}
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

/** Read the observations and the layer of the moment, once the moment rests. */
function readAtMoment(run: Run, painter: PlanPainter, repaint: () => void): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  return effect(() => {
    const step = run.clock.stepAt(state.moment.value);
    void run.version.value;
    const [name, observations] = [state.layer.value, run.observations];
    if (observations && observations.at(step) !== null && !name) return;
    clearTimeout(timer);
    timer = setTimeout(() => {
      void run.attempt(async () => {
        await Promise.all([observations?.load(step), painter.loadLayer(name, step)]);
        repaint();
        if (observations) run.changed();
      });
    }, 120);
  });
}

function followPointer(canvas: HTMLCanvasElement, run: Run, painter: PlanPainter, repaint: () => void): () => void {
  let held: Pointer | null = null;
  const at = (event: PointerEvent | WheelEvent): [number, number] => [event.offsetX, event.offsetY];
  const down = (event: PointerEvent): void => {
    const [x, y] = at(event);
    held = { x, y, moved: false, body: feedOf(run) ? painter.bodyAt(x, y) : "" };
    canvas.setPointerCapture(event.pointerId);
  };
  const move = (event: PointerEvent): void => {
    if (!held) return;
    const [x, y] = at(event);
    if (!held.moved && Math.hypot(x - held.x, y - held.y) < 4) return;
    held.moved = true;
    if (held.body) return;
    painter.shift = [painter.shift[0] + x - held.x, painter.shift[1] + y - held.y];
    [held.x, held.y] = [x, y];
    repaint();
  };
  const up = (event: PointerEvent): void => {
    const [x, y] = at(event);
    const place = painter.placeAt(x, y);
    if (held?.moved && held.body && place) void askPlace(run, held.body, ...place);
    else if (held && !held.moved && calling.value && place) void askCall(run, calling.value, ...place);
    else if (held && !held.moved && placing.value && place) void askPlace(run, placing.value, ...place);
    else if (held && !held.moved) state.select(painter.thingAt(x, y));
    held = null;
  };
  const wheel = (event: WheelEvent): void => {
    event.preventDefault();
    const factor = Math.exp(-event.deltaY * 0.0015);
    const next = Math.max(1, Math.min(40, painter.zoom * factor));
    const [x, y] = [event.offsetX - canvas.clientWidth / 2, event.offsetY - (canvas.clientHeight - FOOT) / 2];
    const share = next / painter.zoom;
    painter.shift = next === 1 ? [0, 0] : [x - (x - painter.shift[0]) * share, y - (y - painter.shift[1]) * share];
    painter.zoom = next;
    repaint();
  };
  const showWholePlan = (): void => {
    painter.zoom = 1;
    painter.shift = [0, 0];
    repaint();
  };
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointermove", move);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("wheel", wheel, { passive: false });
  canvas.addEventListener("dblclick", showWholePlan);
  return () => {
    canvas.removeEventListener("pointerdown", down);
    canvas.removeEventListener("pointermove", move);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("wheel", wheel);
    canvas.removeEventListener("dblclick", showWholePlan);
  };
}
