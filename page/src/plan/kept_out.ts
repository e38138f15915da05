/** Where the robot that is selected keeps out, by its scenario: rooms, kinds of rooms, and areas. */

import type { Run } from "../data/run";
import type { Colors } from "../theme";
import type { Frame } from "./frame";
import { tracePolygons } from "./ground";

type Context = CanvasRenderingContext2D;
type Area = readonly (readonly [number, number])[];

const PITCH_PX = 9;

interface KeptOut {
  rooms: number[];
  areas: Area[];
}

/** An entry of `keep_out`, as a run's scenario has it. */
interface Entry {
  room: string | null;
  area: Area | null;
}

/** What a robot's scenario says it keeps out of, at some hours or always. */
export function keptOut(run: Run, name: string): KeptOut {
  const robots = run.facts.scenario.robots as Record<string, { keep_out?: readonly Entry[] } | undefined> | undefined;
  const entries = robots?.[name]?.keep_out ?? [];
  const names = entries.map((entry) => entry.room);
  const { rooms } = run.facts.home;
  return {
    rooms: [...rooms.keys()].filter((i) => names.includes(rooms[i]!.name) || names.includes(rooms[i]!.type)),
    areas: entries.flatMap((entry) => (entry.area ? [entry.area] : [])),
  };
}

export function drawKeptOut(context: Context, run: Run, selected: string, frame: Frame, colors: Colors): void {
  if (!run.body(selected)?.robot) return;
  const { rooms, areas } = keptOut(run, selected);
  for (const room of rooms) {
    const [left, bottom, right, top] = run.home.floors[room]!.box;
    context.save();
    const transform = context.getTransform();
    frame.enter(context, transform.a);
    context.clip(run.home.floors[room]!.path);
    context.setTransform(transform);
    hatch(context, [frame.x(left), frame.y(top), frame.x(right), frame.y(bottom)], colors);
    context.restore();
  }
  for (const area of areas) {
    const [xs, ys] = [area.map(([x]) => frame.x(x)), area.map(([, y]) => frame.y(y))];
    context.save();
    tracePolygons(context, frame, [area]);
    context.clip();
    hatch(context, [Math.min(...xs), Math.min(...ys), Math.max(...xs), Math.max(...ys)], colors);
    context.restore();
  }
}

function hatch(context: Context, [left, top, right, bottom]: readonly [number, number, number, number], colors: Colors): void {
  const tall = bottom - top;
  context.beginPath();
  for (let x = left - tall; x < right; x += PITCH_PX) {
    context.moveTo(x, bottom);
    context.lineTo(x + tall, top);
  }
  context.strokeStyle = `${colors.alarm}66`;
  context.lineWidth = 1.2;
  context.stroke();
}
