/** Names of rooms on the plan. */

import { beforeAll, expect, test } from "vitest";
import type { Run } from "../src/data/run";
import { bodyRadius, figureDisc, posesAt } from "../src/plan/bodies";
import { Frame } from "../src/plan/frame";
import { Labels, overlap } from "../src/plan/labels";
import { Tags } from "../src/plan/tags";
import { wholeRun } from "./fixture";

let run: Run;

beforeAll(async () => {
  // Node has no canvas: paths are not drawn here.
  Object.assign(globalThis, { Path2D: class { rect(): void {} } });
  run = await wholeRun();
});

/** A context that writes nothing, and measures letters of one width. */
function context(): CanvasRenderingContext2D {
  return { measureText: (text: string) => ({ width: 6.5 * text.length }), fillText: () => undefined } as unknown as CanvasRenderingContext2D;
}

test("no name covers a body at any moment, and names don't cover each other", () => {
  const frame = Frame.fit(run.home, 900, 600);
  const labels = new Labels(context(), run.home, frame, true);
  for (let moment = 0; moment < 200; moment++) {
    const us = (moment * run.presentUs) / 200;
    const bodies = run.bodies.flatMap((body) => {
      const pose = run.tracks.get(body.name)!.poseAt(us);
      return pose.away ? [] : [{ x: frame.ux(pose.x), y: frame.uy(pose.y), radius: bodyRadius(frame, body) }];
    });
    const boxes = labels.place(bodies);
    expect(boxes.length).toBeGreaterThan(3);
    for (const { x, y, radius } of bodies) {
      const body = [x - radius, y - radius, x + radius, y + radius] as const;
      expect(boxes.filter((box) => overlap(box, body))).toEqual([]);
    }
    boxes.forEach((box, i) => expect(boxes.slice(i + 1).filter((other) => overlap(box, other))).toEqual([]));
  }
});

test("every name is within its room", () => {
  const frame = Frame.fit(run.home, 900, 600);
  const boxes = new Labels(context(), run.home, frame, true).place([]);
  for (const [left, top, right, bottom] of boxes) {
    const rooms = [left, right].flatMap((px) =>
      [top, bottom].map((py) => {
        const [x, y] = frame.place(px, py);
        return run.home.roomAt(run.home.units(x, 0), run.home.units(y, 1));
      }),
    );
    expect(new Set(rooms).size).toBe(1);
  }
});

test("no tag covers a body, a name or another tag at any moment, and tags that have no place are counted", () => {
  const frame = Frame.fit(run.home, 900, 600);
  const labels = new Labels(context(), run.home, frame, true);
  const tags = new Tags();
  for (let moment = 0; moment < 200; moment++) {
    const us = (moment * run.presentUs) / 200;
    const poses = posesAt(run, us);
    const discs = run.bodies.map((body) => figureDisc({ run, us, poses, frame }, body)).filter((disc) => disc !== null);
    const names = labels.place(discs);
    const placed = tags.placed(context(), { run, us, poses, frame, names, width: 900, height: 600, selected: "" });
    expect(placed.flatMap(({ stack }) => stack.bodies).length).toBe(discs.length);
    const boxes = placed.map(({ box }) => box).filter((box) => box !== null);
    for (const { x, y, radius } of discs) {
      const body = [x - radius, y - radius, x + radius, y + radius] as const;
      expect(boxes.filter((box) => overlap(box, body))).toEqual([]);
    }
    const all = [...boxes, ...names];
    all.forEach((box, i) => expect(all.slice(i + 1).filter((other) => overlap(box, other))).toEqual([]));
  }
});

test("bodies on one spot share a tag that says how many they are", () => {
  const frame = Frame.fit(run.home, 900, 600);
  const poses = new Map([...posesAt(run, 0)].map(([name, pose]) => [name, { ...pose, x: 4000, y: 4000, away: false }]));
  const [tag, ...others] = new Tags().placed(context(), { run, us: 0, poses, frame, names: [], width: 900, height: 600, selected: "" });
  expect(others).toEqual([]);
  expect(tag!.words).toMatch(new RegExp(`\\+${run.bodies.length - 1}$`));
});
