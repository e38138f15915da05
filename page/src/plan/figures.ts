/** People and robots as figures, seen from above: x is where they look, all lengths follow from the radius. */

import { mix } from "../theme";
import { Pen } from "./pen";

type Context = CanvasRenderingContext2D;
export type Posture = "stand" | "sit" | "lie";

/** How somebody is drawn: the radius of the body, and where a step is, from -1 to 1. */
export interface Look {
  color: string;
  radius: number;
  step: number;
}

function limb(pen: Pen, x0: number, y0: number, x1: number, y1: number, width: number, color: string): void {
  pen.context.lineCap = "round";
  pen.line(x0, y0, x1, y1, color, width);
}

export function drawPerson(context: Context, look: Look, posture: Posture, edge: number): void {
  const pen = new Pen(context);
  if (posture === "lie") return drawSleeper(pen, look);
  const { color, radius: r, step } = look;
  const leg = mix(color, "#20242c", 0.62);
  const arm = mix(color, "#fff0e0", 0.27);
  pen.ellipse(r * 0.14, -r * 0.18, r * 1.05, r * 1.15, "rgba(30, 22, 10, 0.22)");
  for (const side of [1, -1]) {
    if (posture === "sit") {
      limb(pen, 0, side * r * 0.4, r * 1.5, side * r * 0.42, r * 0.42, leg);
      limb(pen, r * 0.1, side * r * 0.9, r * 0.95, side * r * 0.6, r * 0.3, arm);
    } else {
      pen.ellipse(side * step * r * 0.95 + r * 0.1, side * r * 0.42, r * 0.48, r * 0.24, leg);
      limb(pen, 0, side * r * 0.88, -side * step * r * 0.85 + r * 0.15, side * r * 0.98, r * 0.32, arm);
    }
  }
  context.lineWidth = edge;
  pen.ellipse(-r * 0.04, 0, r * 0.56, r * 1.06, color, "#ffffff");
  drawHead(pen, r * 0.14, r * 0.54, color);
}

function drawHead(pen: Pen, x: number, r: number, color: string): void {
  const { context } = pen;
  pen.disc(x, 0, r * 1.15, "#ffffff");
  pen.disc(x, 0, r, mix(color, "#ffffff", 0.82));
  context.beginPath();
  context.arc(x, 0, r * 1.04, Math.PI * 0.44, Math.PI * 1.56);
  context.closePath();
  context.fillStyle = mix(color, "#1b1420", 0.45);
  context.fill();
  pen.disc(x + r * 1.04, 0, r * 0.17, mix(color, "#ffffff", 0.82));
}

/** Under a blanket, with the head behind: people lie with their feet to the front of a bed. */
function drawSleeper(pen: Pen, { color, radius: r }: Look): void {
  const head = -2.5 * r;
  pen.box(head + r, -1.08 * r, 3.5 * r, 1.08 * r, mix(color, "#ffffff", 0.35), 0.64 * r);
  pen.box(head + r, -1.08 * r, head + 1.7 * r, 1.08 * r, mix(color, "#ffffff", 0.62), 0.3 * r);
  drawHead(pen, head, 0.6 * r, color);
}

/** A robot, its charge as a ring, where that is known. */
export function drawRobot(context: Context, { color, radius: r }: Look, charge: number | null, edge: number): void {
  const pen = new Pen(context);
  pen.disc(r * 0.16, -r * 0.26, r * 1.12, "rgba(20, 20, 20, 0.25)");
  pen.disc(0, 0, r * 1.36, "rgba(255, 255, 255, 0.45)");
  context.lineWidth = r * 0.2;
  pen.disc(0, 0, r * 1.26, null, "rgba(20, 40, 45, 0.22)");
  if (charge !== null) {
    context.beginPath();
    context.lineCap = "round";
    context.arc(0, 0, r * 1.26, 0, charge * 2 * Math.PI);
    context.strokeStyle = charge < 0.2 ? "#d5482f" : "#12b5ae";
    context.stroke();
  }
  context.lineWidth = edge;
  pen.disc(0, 0, r, mix(color, "#ffffff", 0.9), mix(color, "#ffffff", 0.45));
  context.beginPath();
  context.arc(0, 0, r * 0.86, -0.95, 0.95);
  context.arc(0, 0, r * 0.38, 0.8, -0.8, true);
  context.closePath();
  context.fillStyle = mix(color, "#0a1014", 0.4);
  context.fill();
  for (const side of [1, -1]) pen.ellipse(r * 0.62, side * r * 0.26, r * 0.1, r * 0.13, "#7df3ea");
}
