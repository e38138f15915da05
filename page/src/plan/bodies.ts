/** What moves on the plan: people, robots, their ways, what is in view, what was noticed. */

import type { BodyFacts, CameraFacts, SlowFacts } from "../contract";
import { isFalse } from "../data/observations";
import type { Run } from "../data/run";
import { type Pose, TURN } from "../data/tracks";
import { bodyColor, cameraColors, type Colors } from "../theme";
import type { Frame } from "./frame";
import { tracePolygons } from "./ground";

type Context = CanvasRenderingContext2D;

const BEHIND_US = 5 * 60e6;
const AHEAD_US = 2 * 60e6;

export interface Scene {
  run: Run;
  us: number;
  frame: Frame;
  colors: Colors;
  selected: string;
  shows: (name: string) => boolean;
  /** Where the bodies of the other run are, when two are compared. */
  other: Run | null;
}

export function angleOf(heading: number): number {
  return (heading * 2 * Math.PI) / TURN;
}

export function drawScene(context: Context, scene: Scene): void {
  const { run, us, shows } = scene;
  const poses = new Map<string, Pose>();
  for (const body of run.bodies) {
    const track = run.tracks.get(body.name);
    if (track && !track.empty) poses.set(body.name, track.poseAt(us));
  }
  if (shows("slows")) drawSlowFloors(context, scene);
  drawDoors(context, scene);
  if (shows("sight")) {
    for (const body of run.bodies) {
      const pose = poses.get(body.name);
      if (pose && !pose.away) body.cameras.forEach((camera, i) => drawView(context, scene, pose, camera, i, body.cameras.length));
    }
  }
  if (shows("ways")) run.bodies.forEach((body) => drawWay(context, scene, body));
  if (scene.other) drawGhosts(context, scene, poses);
  if (shows("observations")) drawObservations(context, scene, poses);
  for (const body of run.bodies) {
    const pose = poses.get(body.name);
    if (pose && !pose.away) drawBody(context, scene, body, pose);
  }
}

/** The floors on which robots are slow at a moment. */
export function slowFloorsAt(run: Run, us: number): SlowFacts[] {
  const step = run.clock.stepAt(us);
  return run.facts.slows.filter((floor) => floor.step <= step && step < floor.end);
}

function drawSlowFloors(context: Context, { run, us, frame, colors }: Scene): void {
  const floors = slowFloorsAt(run, us);
  if (floors.length === 0) return;
  context.save();
  tracePolygons(context, frame, run.facts.home.free.flat());
  context.clip("evenodd");
  for (const floor of floors) {
    tracePolygons(context, frame, [floor.outline]);
    context.fillStyle = `${colors.slow}33`;
    context.fill();
    context.strokeStyle = colors.slow;
    context.lineWidth = 1.5;
    context.setLineDash([2, 3]);
    context.stroke();
    context.setLineDash([]);
  }
  context.restore();
}

function drawDoors(context: Context, { run, us, frame, colors }: Scene): void {
  context.strokeStyle = colors.door;
  for (const door of run.facts.home.doors) {
    const [x0, y0] = [frame.x(door.start[0]), frame.y(door.start[1])];
    const [x1, y1] = [frame.x(door.end[0]), frame.y(door.end[1])];
    context.lineWidth = 3;
    context.beginPath();
    context.moveTo(x0, y0);
    if (run.doorOpen(door.name, us)) context.lineTo(x0 + (y1 - y0), y0 - (x1 - x0));
    else context.lineTo(x1, y1);
    context.stroke();
  }
}

/** Where a camera is [lattice] and looks [rad]. */
export function cameraPose(run: Run, pose: Pose, camera: CameraFacts, us: number): [number, number, number] {
  const body = angleOf(pose.heading);
  const units = run.facts.home.units_per_m;
  const [forward, left] = [camera.forward * units, camera.left * units];
  const x = pose.x + forward * Math.cos(body) - left * Math.sin(body);
  const y = pose.y + forward * Math.sin(body) + left * Math.cos(body);
  const turns = camera.pan.length;
  const pan = turns ? camera.pan[Math.floor(us / camera.pan_us) % turns]! : 0;
  return [Math.round(x), Math.round(y), body + camera.heading + pan];
}

function drawView(context: Context, scene: Scene, pose: Pose, camera: CameraFacts, number: number, cameras: number): void {
  const { run, us, frame, colors } = scene;
  const walls = run.wallsAt(us);
  if (!walls) return;
  const [x, y, heading] = cameraPose(run, pose, camera, us);
  const outline = walls.outline(x, y);
  if (outline.length === 0) return;
  context.save();
  context.beginPath();
  for (let i = 0; i < outline.length; i += 2) context.lineTo(frame.ux(outline[i]!), frame.uy(outline[i + 1]!));
  context.closePath();
  context.clip();
  const [px, py] = [frame.ux(x), frame.uy(y)];
  const [from, to] = [-heading - camera.angle / 2, -heading + camera.angle / 2];
  context.beginPath();
  context.arc(px, py, camera.far * frame.scale, from, to);
  if (camera.near > 0) context.arc(px, py, camera.near * frame.scale, to, from, true);
  else if (camera.angle < 2 * Math.PI - 1e-9) context.lineTo(px, py);
  context.closePath();
  const [fill, edge] = cameraColors(number, colors);
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = edge;
  context.lineWidth = 1;
  context.stroke();
  context.restore();
  if (cameras < 2 || !scene.shows("names")) return;
  const far = Math.min(camera.far * 0.4 * frame.scale, 60);
  drawName(context, colors, camera.name, edge, px + far * Math.cos(-heading), py + far * Math.sin(-heading));
}

function drawWay(context: Context, scene: Scene, body: BodyFacts): void {
  const { run, us, frame, selected } = scene;
  const track = run.tracks.get(body.name);
  if (!track || track.empty) return;
  const behind = track.way(Math.max(0, us - BEHIND_US), us);
  // What a live simulation plans is ahead of its present only.
  const planned = us >= run.knownUs ? run.ahead.get(body.name) : undefined;
  const ahead = planned ?? track.way(us, Math.min(run.presentUs, us + AHEAD_US));
  context.strokeStyle = bodyColor(body.color);
  context.lineWidth = body.name === selected ? 2.5 : 1.5;
  context.lineJoin = "round";
  context.globalAlpha = 0.7;
  strokeLine(context, frame, behind);
  context.setLineDash([2, 4]);
  strokeLine(context, frame, ahead);
  context.setLineDash([]);
  context.globalAlpha = 1;
}

function strokeLine(context: Context, frame: Frame, corners: readonly number[]): void {
  context.beginPath();
  for (let i = 0; i < corners.length; i += 2) context.lineTo(frame.ux(corners[i]!), frame.uy(corners[i + 1]!));
  context.stroke();
}

export function bodyRadius(frame: Frame, body: BodyFacts): number {
  return Math.max(7, body.radius * frame.scale);
}

function drawBody(context: Context, scene: Scene, body: BodyFacts, pose: Pose): void {
  const { frame, colors, selected } = scene;
  const [x, y] = [frame.ux(pose.x), frame.uy(pose.y)];
  const radius = bodyRadius(frame, body);
  const heading = -angleOf(pose.heading);
  const color = bodyColor(body.color);
  if (body.name === selected) {
    context.beginPath();
    context.arc(x, y, radius + 5, 0, 2 * Math.PI);
    context.strokeStyle = colors.cursor;
    context.lineWidth = 2;
    context.stroke();
  }
  context.beginPath();
  if (body.robot) context.roundRect(x - radius, y - radius, 2 * radius, 2 * radius, 0.45 * radius);
  else context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fillStyle = color;
  context.fill();
  context.strokeStyle = colors.ground;
  context.lineWidth = 1.5;
  context.stroke();
  context.beginPath();
  context.moveTo(x + 1.5 * radius * Math.cos(heading), y + 1.5 * radius * Math.sin(heading));
  for (const side of [2.5, -2.5]) {
    context.lineTo(x + radius * Math.cos(heading + side / 4), y + radius * Math.sin(heading + side / 4));
  }
  context.closePath();
  context.fillStyle = color;
  context.fill();
  if (scene.shows("names")) drawName(context, colors, body.name, color, x, y - radius - 8);
}

function drawName(context: Context, colors: Colors, name: string, color: string, x: number, y: number): void {
  context.font = "600 12px system-ui, sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.strokeStyle = colors.halo;
  context.lineWidth = 3.5;
  context.strokeText(name, x, y);
  context.fillStyle = color;
  context.fillText(name, x, y);
}

function drawObservations(context: Context, scene: Scene, poses: ReadonlyMap<string, Pose>): void {
  const { run, us, frame, colors } = scene;
  for (const sighting of run.observations?.at(run.clock.stepAt(us)) ?? []) {
    const robot = poses.get(sighting.robot);
    const [x, y] = [frame.x(sighting.x), frame.y(sighting.y)];
    const isWrong = isFalse(sighting);
    context.strokeStyle = isWrong ? colors.alarm : colors.viewEdge;
    context.lineWidth = isWrong ? 2 : 1.5;
    if (robot && !robot.away) {
      context.setLineDash([3, 3]);
      context.beginPath();
      context.moveTo(frame.ux(robot.x), frame.uy(robot.y));
      context.lineTo(x, y);
      context.stroke();
      context.setLineDash([]);
    }
    context.beginPath();
    context.arc(x, y, 11, 0, 2 * Math.PI);
    context.stroke();
    if (isWrong) {
      context.beginPath();
      context.moveTo(x - 7, y - 7);
      context.lineTo(x + 7, y + 7);
      context.moveTo(x + 7, y - 7);
      context.lineTo(x - 7, y + 7);
      context.stroke();
      drawName(context, colors, `${sighting.user || "somebody"}?`, colors.alarm, x, y - 18);
    }
  }
}

/** Where the other run has the bodies of the same names, if that is elsewhere. */
function drawGhosts(context: Context, scene: Scene, poses: ReadonlyMap<string, Pose>): void {
  const { run, other, us, frame, colors } = scene;
  for (const body of run.bodies) {
    const pose = poses.get(body.name);
    const otherPose = other?.tracks.get(body.name)?.poseAt(us);
    if (!pose || !otherPose || otherPose.away) continue;
    const far = Math.hypot(otherPose.x - pose.x, otherPose.y - pose.y) / run.facts.home.units_per_m;
    if (!pose.away && far < 0.1) continue;
    const [x, y] = [frame.ux(otherPose.x), frame.uy(otherPose.y)];
    context.strokeStyle = colors.alarm;
    context.lineWidth = 1.5;
    context.setLineDash([5, 4]);
    context.beginPath();
    context.arc(x, y, bodyRadius(frame, body), 0, 2 * Math.PI);
    context.stroke();
    if (!pose.away) {
      context.beginPath();
      context.moveTo(frame.ux(pose.x), frame.uy(pose.y));
      context.lineTo(x, y);
      context.stroke();
    }
    context.setLineDash([]);
  }
}
