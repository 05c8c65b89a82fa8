/* The model in three dimensions: orthographic projection and drawing on a canvas. */
{
  const add = (a, b, factor = 1) => [a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2]];
  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  /** Return centre and size (radius in m) of the nodes. */
  const extent = (nodes) => {
    const low = [0, 1, 2].map((k) => Math.min(...nodes.map((node) => node[k])));
    const high = [0, 1, 2].map((k) => Math.max(...nodes.map((node) => node[k])));
    const centre = low.map((value, k) => (value + high[k]) / 2);
    return { centre, radius: Math.max(Math.hypot(...high.map((value, k) => value - low[k])) / 2, 1e-9) };
  };

  /** Return the nodes of every member in order, as chains to draw smooth lines through. */
  const chains = (stage) => {
    const found = [];
    stage.elements.forEach(([start, stop], i) => {
      const last = found[found.length - 1];
      const member = stage.member_of[i];
      if (last && last.member === member && last.nodes[last.nodes.length - 1] === start) last.nodes.push(stop);
      else found.push({ member, nodes: [start, stop] });
    });
    return found;
  };

  /** Return where a sensor lies on the mesh: [node, node, share], its node or the nearest element. */
  const locate = (stage, { node, xyz }) => {
    if (node !== null && node !== undefined) return [node, node, 0];
    let best = [0, 0, 0];
    let least = Infinity;
    for (const [i, j] of stage.elements) {
      const along = add(stage.nodes[j], stage.nodes[i], -1);
      const share = Math.min(Math.max(dot(add(xyz, stage.nodes[i], -1), along) / (dot(along, along) || 1), 0), 1);
      const gap = Math.hypot(...add(add(xyz, stage.nodes[i], -1), along, -share));
      if (gap < least) [least, best] = [gap, [i, j, share]];
    }
    return best;
  };

  /** Return the motion of a located point in a shape. */
  const motion = (shape, [i, j, share]) => add(shape[i].map((part) => part * (1 - share)), shape[j], share);

  /** Return what the sensors read of a shape; null for rotations, which shapes do not have. */
  const readings = (stage, shape) =>
    stage.sensors.map((sensor) => (sensor.rotation ? null : dot(motion(shape, locate(stage, sensor)), sensor.axis)));

  /** Return the factor that brings measured readings nearest to predicted ones, and their MAC. */
  const match = (measured, predicted) => {
    let [mm, mp, pp] = [0, 0, 0];
    measured.forEach((value, i) => {
      if (value === null || predicted[i] === null) return;
      mm += value * value;
      mp += value * predicted[i];
      pp += predicted[i] * predicted[i];
    });
    return { factor: mm ? mp / mm : 0, mac: mm * pp ? (mp * mp) / (mm * pp) : 0 };
  };

  /** Return the function from (x, y, z) in m to px, for a view of given size. */
  const projection = (view, frame, width, height) => {
    const [a, e] = [(view.azimuth * Math.PI) / 180, (view.elevation * Math.PI) / 180];
    const right = [Math.cos(a), Math.sin(a), 0];
    const up = [-Math.sin(e) * Math.sin(a), Math.sin(e) * Math.cos(a), Math.cos(e)];
    const scale = (view.zoom * view.fit * Math.min(width, height * 1.6)) / (2 * frame.radius);
    const project = (xyz) => {
      const from = add(xyz, frame.centre, -1);
      return [width / 2 + scale * dot(from, right), height / 2 - scale * dot(from, up)];
    };
    return { project, right, up, scale };
  };

  /** Return the scale at which the structure, as it is first seen, fills the canvas with its shapes. */
  const fit = (view, frame, stage, reach, width, height) => {
    const { project } = projection({ ...view, zoom: 1, fit: 1 }, frame, width, height);
    const axes = [...new Map(stage.sensors.filter(({ rotation }) => !rotation).map(({ axis }) => [axis.map(Math.abs).join(), axis])).values()];
    const moved = (node) => axes.flatMap((axis) => [add(node, axis, reach), add(node, axis, -reach)]);
    const points = stage.nodes.flatMap((node) => [node, ...moved(node)]).map(project);
    const half = (k, size) => Math.max(...points.map((p) => Math.abs(p[k] - size / 2)), 1);
    return Math.min((width / 2 - 40) / half(0, width), (height / 2 - 26) / half(1, height));
  };

  /** Draw a smooth line through points (Catmull-Rom). */
  const spline = (pen, points) => {
    pen.beginPath();
    pen.moveTo(...points[0]);
    for (let i = 0; i + 1 < points.length; i += 1) {
      const [p0, p1, p2, p3] = [points[i - 1] ?? points[i], points[i], points[i + 1], points[i + 2] ?? points[i + 1]];
      pen.bezierCurveTo(
        p1[0] + (p2[0] - p0[0]) / 6, p1[1] + (p2[1] - p0[1]) / 6,
        p2[0] - (p3[0] - p1[0]) / 6, p2[1] - (p3[1] - p1[1]) / 6, p2[0], p2[1]);
    }
    pen.stroke();
  };

  const arrow = (pen, from, to) => {
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
    pen.beginPath();
    pen.moveTo(...from);
    pen.lineTo(...to);
    pen.stroke();
    if (length < 2) return;
    const [dx, dy] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
    const head = Math.min(8, 0.6 * length);
    pen.beginPath();
    pen.moveTo(...to);
    pen.lineTo(to[0] - head * dx - 0.5 * head * dy, to[1] - head * dy + 0.5 * head * dx);
    pen.lineTo(to[0] - head * dx + 0.5 * head * dy, to[1] - head * dy - 0.5 * head * dx);
    pen.closePath();
    pen.fill();
  };

  /** Write text on a ground of its own, so that lines behind it do not disturb. */
  const write = (pen, text, x, y, colours, colour = colours.ink) => {
    pen.lineWidth = 3;
    pen.lineJoin = "round";
    pen.strokeStyle = colours.page;
    pen.strokeText(text, x, y);
    pen.fillStyle = colour;
    pen.fillText(text, x, y);
  };

  /** Write text at the first free place around a point; where there is none, only if it must be there. */
  const label = (scene, text, [x, y], colour, must = false) => {
    const { pen, colours, boxes } = scene;
    const wide = pen.measureText(text).width;
    const spots = [[8, -7], [8, 15], [-8 - wide, -7], [-8 - wide, 15], [-wide / 2, -12], [-wide / 2, 21]];
    const boxAt = ([dx, dy]) => ({ l: x + dx - 1, r: x + dx + wide + 1, t: y + dy - 11, b: y + dy + 3 });
    const free = (o) => !boxes.some((box) => o.l < box.r && o.r > box.l && o.t < box.b && o.b > box.t);
    const spot = spots.find((one) => free(boxAt(one))) ?? (must ? spots[0] : null);
    if (!spot) return;
    boxes.push(boxAt(spot));
    write(pen, text, x + spot[0], y + spot[1], colours, colour);
  };

  const zigzag = (pen, from, to) => {
    const [dx, dy] = [to[0] - from[0], to[1] - from[1]];
    const length = Math.hypot(dx, dy) || 1;
    pen.beginPath();
    pen.moveTo(...from);
    for (let k = 1; k < 9; k += 1) {
      const side = k % 2 ? 4 : -4;
      pen.lineTo(from[0] + (dx * k) / 9 - (side * dy) / length, from[1] + (dy * k) / 9 + (side * dx) / length);
    }
    pen.lineTo(...to);
    pen.moveTo(to[0] - (7 * dy) / length, to[1] + (7 * dx) / length);
    pen.lineTo(to[0] + (7 * dy) / length, to[1] - (7 * dx) / length);
    pen.stroke();
  };

  const attachments = (scene) => {
    const { pen, stage, project, colours, show } = scene;
    if (!show.attached) return;
    for (const spring of stage.springs) {
      const from = project(spring.xyz);
      const tip = project(add(spring.xyz, spring.axis, -0.12 * scene.frame.radius));
      const flat = Math.hypot(tip[0] - from[0], tip[1] - from[1]) < 12;
      pen.strokeStyle = colours.attached;
      pen.lineWidth = 1.8;
      zigzag(pen, from, flat ? [from[0], from[1] + 26] : tip);
      label(scene, `${bench.heat.scientific(spring.stiffness)} N/m`, flat ? [from[0], from[1] + 26] : tip, colours.ink, true);
    }
    for (const support of stage.supports) {
      const [x, y] = project(support.xyz);
      pen.fillStyle = colours.attached;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x - 8, y + 13);
      pen.lineTo(x + 8, y + 13);
      pen.fill();
      label(scene, `held ${support.fixed.join(" ")}`, [x, y + 8], colours.ink, true);
    }
    for (const mass of stage.masses) {
      const [x, y] = project(mass.xyz);
      pen.fillStyle = colours.attached;
      pen.fillRect(x - 5, y - 5, 10, 10);
      const text = mass.kg < 1 ? `${Number((1000 * mass.kg).toPrecision(3))} g` : `${Number(mass.kg.toPrecision(3))} kg`;
      label(scene, text, [x, y], colours.ink, true);
    }
  };

  const axes = (scene) => {
    const { pen, right, up, colours, height } = scene;
    const from = [34, height - 34];
    pen.font = scene.font;
    ["x", "y", "z"].forEach((name, k) => {
      const to = [from[0] + 24 * right[k], from[1] - 24 * up[k]];
      pen.strokeStyle = pen.fillStyle = colours.soft;
      pen.lineWidth = 1.5;
      arrow(pen, from, to);
      if (Math.hypot(to[0] - from[0], to[1] - from[1]) > 6) {
        write(pen, name, from[0] + 32 * right[k] - 3, from[1] - 32 * up[k] + 4, colours, colours.soft);
      }
    });
  };

  const measuredArrows = (scene) => {
    const { pen, stage, project, colours, arrows, reach, where } = scene;
    if (!arrows || !scene.show.measured) return;
    stage.sensors.forEach((sensor, i) => {
      if (arrows[i] === null || sensor.rotation) return;
      const tip = project(add(sensor.xyz, sensor.axis, arrows[i] * reach));
      pen.strokeStyle = pen.fillStyle = colours.measured;
      pen.lineWidth = 2;
      arrow(pen, where[i], tip);
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.arc(...tip, 3.5, 0, 7);
      pen.stroke();
    });
  };

  const joints = (scene) => {
    const { pen, stage, project, colours, show } = scene;
    for (const joint of stage.joints) {
      const at = project(stage.nodes[joint.node]);
      pen.fillStyle = colours.ink;
      pen.beginPath();
      pen.arc(...at, 3, 0, 7);
      pen.fill();
      if (show.joints) label(scene, joint.type && joint.type !== joint.name ? `${joint.name} (${joint.type})` : joint.name, at, colours.ink, true);
    }
  };

  const sensors = (scene) => {
    const { pen, stage, project, colours, show, where } = scene;
    stage.sensors.forEach((sensor, i) => {
      const [x, y] = where[i];
      pen.strokeStyle = pen.fillStyle = colours.measured;
      pen.lineWidth = 1.5;
      pen.strokeRect(x - 2.5, y - 2.5, 5, 5);
      if (!show.sensors) return;
      if (!scene.arrows && !sensor.rotation) arrow(pen, where[i], project(add(sensor.xyz, sensor.axis, 0.09 * scene.frame.radius)));
      label(scene, sensor.label, where[i], colours.measured);
    });
  };

  /**
   * Draw one picture.
   *
   * state: stage, view, frame, chains, shape (per node or null), arrows (readings per sensor or
   * null), reach (m of a reading of 1), phase (-1..1), show (joints, sensors, attached, measured).
   */
  const draw = (canvas, state) => {
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    const ratio = window.devicePixelRatio || 1;
    const wide = Math.round(width * ratio);
    const high = Math.round(height * ratio);
    if (canvas.width !== wide || canvas.height !== high) [canvas.width, canvas.height] = [wide, high];
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineCap = "round";
    const reach = state.reach * state.phase;
    const scene = { ...state, ...projection(state.view, state.frame, width, height), pen, reach, height, boxes: [],
      font: `12px ${state.colours.font}` };
    const { stage, shape, project } = scene;
    scene.where = stage.sensors.map((sensor) => project(sensor.xyz));
    const still = stage.nodes.map(project);
    const mark = ([x, y]) => pen.strokeRect(x - 1, y - 1, 2, 2);
    const line = (points) => {
      state.chains.forEach((chain) => spline(pen, chain.nodes.map((node) => points[node])));
      if (!state.chains.length) points.forEach(mark); // matrices have nodes without elements
    };
    pen.strokeStyle = state.colours.still;
    pen.lineWidth = shape ? 1.5 : 4;
    line(still);
    if (shape) {
      const moved = stage.nodes.map((node, i) => project(add(node, shape[i], reach)));
      pen.strokeStyle = state.colours.shape;
      pen.lineWidth = 4;
      line(moved);
      pen.fillStyle = state.colours.shape;
      for (const joint of stage.joints) {
        pen.beginPath();
        pen.arc(...moved[joint.node], 4.5, 0, 7);
        pen.fill();
      }
    }
    pen.font = scene.font;
    joints(scene);
    attachments(scene);
    measuredArrows(scene);
    sensors(scene);
    axes(scene);
  };

  bench.scene = { extent, chains, readings, match, fit, draw };
}
