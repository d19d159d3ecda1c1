// The function that the page begins with.
export const EXAMPLE = `// Called at every sample s, which has time and, as pairs [x, y], position, velocity, reference,
// reference_velocity, reference_acceleration, error and error_rate. All is nondimensional.
// plant has step, and the nominal damping and stiffness as [xx, xy, yy].
const [D, K] = [plant.damping, plant.stiffness];
const w = 0.2 / plant.step; // bandwidth
let rate = 0; // the estimate, which the error corrects

function force(s) {
  const [x, y] = s.position, [vx, vy] = s.velocity;
  const [ex, ey] = s.error, [dx, dy] = s.error_rate, [ax, ay] = s.reference_acceleration;
  rate += 0.1 * ((dx + 0.5 * w * ex) * vy - (dy + 0.5 * w * ey) * vx);
  const ux = ax + D[0] * vx + D[1] * vy + K[0] * x + K[1] * y - 2 * rate * vy;
  const uy = ay + D[1] * vx + D[2] * vy + K[1] * x + K[2] * y + 2 * rate * vx;
  return [ux - w * w * ex - 1.4 * w * dx, uy - w * w * ey - 1.4 * w * dy];
}

// Optional: numbers that are recorded; the page draws rate_estimate.
function report() {
  return { rate_estimate: rate };
}
`;
