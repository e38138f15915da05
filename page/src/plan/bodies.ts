/** What moves on the plan: people, robots, their ways, what is in view, what was noticed. */

import type { BodyFacts, CameraFacts, SlowFacts, UseFacts } from "../contract";
import { isFalse } from "../data/observations";
import type { Run } from "../data/run";
import { type Pose, TURN } from "../data/tracks";
import { cameraColors, type Colors, mix } from "../theme";
import type { Posture } from "./figures";
import type { Frame } from "./frame";
import { drawLeaf, tracePolygons } from "./ground";
import { Pen } from "./pen";
import { drawFigure } from "./sprites";

type Context = CanvasRenderingContext2D;

const BEHIND_US = 5 * 60e6;
const AHEAD_US = 2 * 60e6;
const FADES = 5;

export interface Scene {
  run: Run;
  us: number;
  poses: ReadonlyMap<string, Pose>;
  frame: Frame;
  colors: Colors;
  selected: string;
  /** Whether people's legs move as they walk. */
  steps: boolean;
  shows: (name: string) => boolean;
  /** Where the bodies of the other run are, when two are compared. */
  other: Run | null;
  /** The least radius of a body [px]; left out: that of the plan. */
  smallest?: number;
}

export function angleOf(heading: number): number {
  return (heading * 2 * Math.PI) / TURN;
}

/** Where everybody is whose track is read. */
export function posesAt(run: Run, us: number): Map<string, Pose> {
  const poses = new Map<string, Pose>();
  for (const body of run.bodies) {
    const track = run.tracks.get(body.name);
    if (track && !track.empty) poses.set(body.name, track.poseAt(us));
  }
  return poses;
}

export function drawScene(context: Context, scene: Scene): void {
  const { run, poses, shows } = scene;
  if (shows("slows")) drawSlowFloors(context, scene);
  drawDoors(context, scene);
  if (shows("sight")) {
    for (const body of run.bodies) {
      const pose = poses.get(body.name);
      if (pose && !pose.away) body.cameras.forEach((camera, i) => drawView(context, scene, pose, camera, i, body.cameras.length));
    }
  }
  if (shows("ways")) drawWays(context, scene);
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

/** Doors that can be shut: open with their swing, or shut. */
function drawDoors(context: Context, { run, us, frame, colors }: Scene): void {
  for (const { name, start, end } of run.facts.home.doors) {
    const width = Math.hypot(end[0] - start[0], end[1] - start[1]);
    context.save();
    context.translate(frame.x(start[0]), frame.y(start[1]));
    context.scale(frame.scale, -frame.scale);
    context.rotate(Math.atan2(end[1] - start[1], end[0] - start[0]));
    const pen = new Pen(context);
    if (run.doorOpen(name, us)) drawLeaf(pen, width);
    else pen.box(0, -0.05, width, 0.05, colors.door, 0.02);
    context.restore();
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
  const [color, edge] = cameraColors(number, colors);
  const far = camera.far * frame.scale;
  const fill = context.createRadialGradient(px, py, 0, px, py, Math.max(1, far));
  for (const [at, opacity] of [[0, "6b"], [0.55, "38"], [1, "0a"]] as const) fill.addColorStop(at, `${color}${opacity}`);
  context.fillStyle = fill;
  context.fill();
  context.strokeStyle = `${edge}66`;
  context.lineWidth = 1;
  context.stroke();
  context.restore();
  if (cameras < 2 || !scene.shows("names")) return;
  const out = Math.min(0.4 * far, 60);
  drawName(context, colors, camera.name, edge, px + out * Math.cos(-heading), py + out * Math.sin(-heading));
}

/**
 * The ways behind bodies fade with their age; the ways ahead are dashed. Those of one look are one path: in a crowd, a
 * few long strokes are cheaper than hundreds of short ones.
 */
function drawWays(context: Context, scene: Scene): void {
  const { run, us, selected } = scene;
  const looks = new Map<string, BodyFacts[]>();
  for (const body of run.bodies) {
    const look = body.name === selected ? "selected" : body.color;
    const alike = looks.get(look);
    if (alike) alike.push(body);
    else looks.set(look, [body]);
  }
  context.lineJoin = "round";
  for (const [look, bodies] of looks) {
    context.strokeStyle = bodies[0]!.color;
    context.lineCap = "round";
    const tracks = bodies.flatMap(({ name }) => run.tracks.get(name) ?? []);
    const walked = tracks.filter((track) => track.movesWithin(Math.max(0, us - BEHIND_US), us));
    for (let i = 0; i < FADES && walked.length > 0; i++) {
      const from = us - (BEHIND_US * (FADES - i)) / FADES;
      context.globalAlpha = (look === "selected" ? 0.7 : 0.5) * ((i + 1) / FADES) ** 1.5;
      context.lineWidth = (look === "selected" ? 4 : 2.5) * ((i + 2) / (FADES + 1));
      const ways = walked.map((track) => track.way(Math.max(0, from), Math.max(0, from + BEHIND_US / FADES)));
      strokeLines(context, scene.frame, ways);
    }
    context.globalAlpha = 0.5;
    context.lineWidth = 1.5;
    context.lineCap = "butt";
    context.setLineDash([2, 4]);
    strokeLines(context, scene.frame, bodies.map((body) => wayAhead(scene, body)));
    context.setLineDash([]);
  }
  context.globalAlpha = 1;
}

/** What a live simulation plans is ahead of its present only. */
function wayAhead({ run, us }: Scene, { name }: BodyFacts): readonly number[] {
  const track = run.tracks.get(name);
  const planned = us >= run.knownUs ? run.ahead.get(name) : undefined;
  const end = Math.min(run.presentUs, us + AHEAD_US);
  return planned ?? (track?.movesWithin(us, end) ? track.way(us, end) : []);
}

/** Corners of a way that are nearer to each other are one [px]. */
const FINEST_PX = 1.5;

function strokeLines(context: Context, frame: Frame, lines: readonly (readonly number[])[]): void {
  context.beginPath();
  for (const corners of lines) {
    let [lastX, lastY] = [Infinity, Infinity];
    for (let i = 0; i < corners.length; i += 2) {
      const [x, y] = [frame.ux(corners[i]!), frame.uy(corners[i + 1]!)];
      const isEnd = i + 2 === corners.length;
      if (!isEnd && Math.abs(x - lastX) + Math.abs(y - lastY) < FINEST_PX) continue;
      if (i === 0) context.moveTo(x, y);
      else context.lineTo(x, y);
      [lastX, lastY] = [x, y];
    }
  }
  context.stroke();
}

const SMALLEST_PX = 9;

export function bodyRadius(frame: Frame, body: BodyFacts, smallest = SMALLEST_PX): number {
  return Math.max(smallest, body.radius * frame.scale);
}

/** A figure reaches so far from its middle [radii]: who lies is long. */
const FIGURE_REACH = 1.35;
const LYING_REACH = 4;

/** The radius with which somebody is drawn [px]: who lies is long, and so is drawn closer to life, to stay on the bed. */
function figureRadius({ frame, smallest = SMALLEST_PX }: Pick<Scene, "frame" | "smallest">, body: BodyFacts, use: UseFacts | null): number {
  return bodyRadius(frame, body, use?.posture === "lie" ? smallest / 2 : smallest);
}

/** A circle that holds the figure of somebody who is at home [px]; null where nobody is seen. */
export function figureDisc(scene: Pick<Scene, "run" | "us" | "poses" | "frame" | "smallest">, body: BodyFacts): { x: number; y: number; radius: number } | null {
  const { run, us, poses, frame } = scene;
  const pose = poses.get(body.name);
  if (!pose || pose.away) return null;
  const use = usePlace(run, body, pose, us);
  const reach = use?.posture === "lie" ? LYING_REACH : FIGURE_REACH;
  const [x, y] = use ? [frame.x(use.x), frame.y(use.y)] : [frame.ux(pose.x), frame.uy(pose.y)];
  return { x, y, radius: reach * figureRadius(scene, body, use) };
}

/** Farther than this from a place to use furniture, nobody uses it [m]; the same as in `fleet2d.viewing.postures`. */
const USED_WITHIN_M = 0.16;
const GLANCE_US = 0.5e6;

/** The place on which somebody sits or lies at a moment; in a live run, that of who stands still there. */
function usePlace(run: Run, body: BodyFacts, pose: Pose, us: number): UseFacts | null {
  if (body.robot) return null;
  if (run.postures) return run.postures.at(body.name, us);
  if (isMoving(run, body, pose, us)) return null;
  const [x, y] = [run.home.metres(pose.x, 0), run.home.metres(pose.y, 1)];
  return run.home.restPlaces.find((use) => Math.hypot(use.x - x, use.y - y) < USED_WITHIN_M) ?? null;
}

function isMoving(run: Run, body: BodyFacts, pose: Pose, us: number): boolean {
  const later = run.tracks.get(body.name)!.poseAt(Math.min(us + GLANCE_US, run.presentUs));
  return later.x !== pose.x || later.y !== pose.y;
}

/** The phase of a step, which follows the clock of who watches: at any speed people walk at ease. */
const STEP_MS = 170;

function drawBody(context: Context, scene: Scene, body: BodyFacts, pose: Pose): void {
  const { run, us, frame, colors, selected } = scene;
  const { color } = body;
  const use = usePlace(run, body, pose, us);
  const radius = figureRadius(scene, body, use);
  const x = use ? frame.x(use.x) : frame.ux(pose.x);
  const y = use ? frame.y(use.y) : frame.uy(pose.y);
  const heading = use ? use.heading : angleOf(pose.heading);
  if (body.name === selected) {
    context.beginPath();
    context.arc(x, y, 1.6 * radius + 3, 0, 2 * Math.PI);
    context.fillStyle = `${mix(color, colors.ground, 0.2)}33`;
    context.fill();
    context.strokeStyle = colors.cursor;
    context.lineWidth = 2;
    context.stroke();
  }
  const walks = scene.steps && !body.robot && isMoving(run, body, pose, us);
  const step = walks ? Math.sin(performance.now() / STEP_MS) : 0;
  const posture = body.robot ? null : ((use?.posture ?? "stand") as Posture);
  drawFigure(context, { x, y, heading, radius, color, step, posture });
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
