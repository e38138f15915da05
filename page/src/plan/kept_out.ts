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

/** What a robot's scenario says it keeps out of. */
export function keptOut(run: Run, name: string): KeptOut {
  const robots = run.facts.scenario.robots as Record<string, { keep_out?: readonly unknown[] } | undefined> | undefined;
  const entries = robots?.[name]?.keep_out ?? [];
  const { rooms } = run.facts.home;
  return {
    rooms: [...rooms.keys()].filter((i) => entries.includes(rooms[i]!.name) || entries.includes(rooms[i]!.type)),
    areas: entries.filter(isArea),
  };
}

function isArea(entry: unknown): entry is Area {
  return Array.isArray(entry) && entry.length >= 3 && entry.every((point) => Array.isArray(point) && point.length === 2);
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
