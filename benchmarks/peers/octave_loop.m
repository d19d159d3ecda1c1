% The closed loop in Octave, vectorised: both fractional terms as sums over the whole history, Grünwald-Letnikov.
%     octave-cli octave_loop.m NOISE POSITIONS
% NOISE holds doubles, x and y of each sample; POSITIONS receives the same. Prints the seconds that the loop took.
1;

function q = simulate(noise, h, alpha)
  count = columns(noise);
  k = 1:count - 1;
  of_integral = fliplr([1, cumprod((k - alpha) ./ k)])' / h^(alpha - 1);
  of_derivative = fliplr([1, cumprod((k - 1 - alpha) ./ k)])' / h^alpha;
  of_both = [of_integral, of_derivative];
  D = [0.01, 0.002; 0.002, 0.01];
  K = [63.955, 12.779; 12.779, 95.92] / 0.18;
  W = [0, -0.1; 0.1, 0];
  step = expm(h * [zeros(2), eye(2), zeros(2); -K, -(D + 2 * W), eye(2); zeros(2, 6)])(1:4, :);
  D *= 0.95; K *= 0.95; W *= 0.95;
  b = [0.1; 0.2; 0.3];
  state = [0.5; 0.5; 0; 0];
  t = h * (0:count - 1);
  r = [sin(pi * t); cos(pi / 2 * t)];
  dr = [pi * cos(pi * t); -pi / 2 * sin(pi / 2 * t)];
  ddr = [-pi^2; -pi^2 / 4] .* r;
  e = zeros(2, count);
  q = zeros(2, count);
  for n = 1:count
    x = state(1:2);
    v = state(3:4);
    e(:, n) = x - r(:, n);
    de = v - dr(:, n);
    sums = e(:, 1:n) * of_both(end - n + 1:end, :);
    size = abs(e(:, n));
    s = de + 10 * sums(:, 1) + 0.5 * sqrt(size) .* sign(e(:, n));
    norms = [1; norm(x); norm(v)];
    u = (D + 2 * W) * v + K * x + ddr(:, n) - 10 * sums(:, 2) - 0.25 * de ./ sqrt(max(size, 1e-6));
    u -= b' * norms / max(norm(s), 0.06) * s;
    vs = v * s';
    xs = x * s';
    D -= h * 75 * (vs + vs');
    K -= h * 75 * (xs + xs');
    W += h * 150 * (vs - vs');
    b += h * norm(s) * [1; 1.6; 1.6] .* norms;
    q(:, n) = x;
    state = step * [state; u + noise(:, n)];
  end
end

files = argv();
from = fopen(files{1}, "r");
noise = fread(from, [2, Inf], "double");
fclose(from);
tic;
q = simulate(noise, 1e-3, 0.9);
printf("%.9f\n", toc);
to = fopen(files{2}, "w");
fwrite(to, q, "double");
fclose(to);
