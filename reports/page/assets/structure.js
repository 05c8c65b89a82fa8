/* The structure view: turn, zoom, pick a mode and a strategy, play it; by mouse, touch and keys. */
{
  const START = {
    "out-of-plane": { azimuth: 32, elevation: 34 },
    "in-plane": { azimuth: 14, elevation: 12 },
    "3d": { azimuth: 34, elevation: 24 },
  };
  const CYCLE = 2400; // ms of one period on the screen
  const REACH = 0.22; // of the radius of the structure, a reading of 1 at an amplitude of 1
  const BLOCKS = { used: "used", higher: "held out", modified: "modified, held out" };
  const HELP =
    "Arrow keys or dragging turn the structure, + and - or two fingers or the wheel (once it has the focus) zoom, " +
    "R resets, space plays and pauses, N and P go to the next and previous mode.";

  const hz = (value) => (value < 0 ? `${(-value).toPrecision(5)}i` : Number(value.toPrecision(5)).toString()) + " Hz";
  const same = (a, b) => (a ?? null) === (b ?? null);

  /** Return the modes that can be picked: every measured one, then what the model has besides. */
  const modesOf = (stage, entry) => {
    const own = entry && entry.exhibit ? entry.exhibit.modes : [];
    const measured = stage.measured.map((mode) => ({
      measured: mode,
      predicted: own.find((item) => item.paired === mode.mode && same(item.modification, mode.modification)) ?? null,
    }));
    const alone = own.filter((item) => item.paired === null).map((item) => ({ measured: null, predicted: item }));
    return [...measured, ...alone];
  };

  const keyOf = (mode) =>
    mode.measured ? `m${mode.measured.mode}/${mode.measured.modification ?? ""}`
      : `p${mode.predicted.hz}/${mode.predicted.modification ?? ""}`;

  const optionText = (mode) => {
    const { measured, predicted } = mode;
    if (!measured) return `not measured, ${hz(predicted.hz)}`;
    return `${measured.mode} (${BLOCKS[measured.block]}), ${hz(measured.hz)}`;
  };

  /** Return the sentence under the picture. */
  const sentence = (mode, name, mac, scored) => {
    const { measured, predicted } = mode;
    const change = (measured ?? predicted).modification;
    const after = change ? `, with \u201c${change}\u201d` : "";
    if (!measured) return `${name}: a mode at ${hz(predicted.hz)} that no measured mode belongs to${after}`;
    const head = `Mode ${measured.mode} (${BLOCKS[measured.block]})${after}: measured ${hz(measured.hz)}`;
    if (!name) return `${head}; no predicted shapes are stored`;
    const own = predicted ? predicted.hz : scored ? scored.predicted_hz : null;
    if (own === null) return `${head}; ${name} has no ${change && !scored ? "stored shape" : "mode"} that belongs to it`;
    const size = Math.abs(100 * (own / measured.hz - 1)).toFixed(2);
    const signed = `${Number(size) === 0 ? "" : own < measured.hz ? "\u2212" : "+"}${size} %`;
    const likeness = mac === null ? "" : `, MAC ${mac.toFixed(3)}`;
    return `${head}, ${name} ${hz(own)} (${signed})${likeness}${predicted ? "" : "; its shape is not stored"}`;
  };

  const colours = (canvas) => {
    const style = getComputedStyle(canvas);
    const get = (name) => style.getPropertyValue(name).trim();
    return { ink: style.color, font: style.fontFamily, page: get("--view-page"), soft: get("--view-soft"), still: get("--view-still"),
      shape: get("--view-shape"), measured: get("--view-measured"), attached: get("--view-attached") };
  };

  const choice = (label, options, change) => {
    const select = bench.el("select", { "aria-label": label }, ...options);
    select.addEventListener("change", () => change(select.value));
    return [bench.el("label", { class: "case-field" }, `${label} `, select), select];
  };

  const option = (value, text) => {
    const item = document.createElement("option");
    item.value = value;
    item.textContent = text;
    return item;
  };

  const button = (label, sign, act) => {
    const item = bench.el("button", { type: "button", class: "case-button" }, sign);
    item.setAttribute("aria-label", label);
    item.title = label;
    item.addEventListener("click", act);
    return item;
  };

  const check = (label, on, change) => {
    const box = bench.el("input", { type: "checkbox" });
    box.checked = on;
    box.addEventListener("change", () => change(box.checked));
    return bench.el("label", { class: "case-check" }, box, ` ${label}`);
  };

  /** Fill the list of modes, in groups by modification. */
  const fillModes = (select, modes) => {
    const groups = new Map();
    modes.forEach((mode) => {
      const change = (mode.measured ?? mode.predicted).modification;
      const name = `${change ? `With \u201c${change}\u201d` : "As tested"}${mode.measured ? "" : ", model only"}`;
      if (!groups.has(name)) {
        const group = document.createElement("optgroup");
        group.label = name;
        groups.set(name, group);
      }
      groups.get(name).append(option(keyOf(mode), optionText(mode)));
    });
    select.replaceChildren(...groups.values());
  };

  /** Turn and zoom by pointer and wheel. */
  const listen = (canvas, turn, zoom) => {
    const pointers = new Map();
    let spread = 0;
    const apart = () => {
      const [a, b] = [...pointers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      if (pointers.size === 2) spread = apart();
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = pointers.get(event.pointerId);
      if (!last) return;
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      if (pointers.size === 1) return turn(-0.4 * (event.clientX - last[0]), 0.4 * (event.clientY - last[1]));
      const now = apart();
      if (spread > 0) zoom(now / spread);
      spread = now;
    });
    const end = (event) => pointers.delete(event.pointerId);
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
    canvas.addEventListener("wheel", (event) => {
      // A page that scrolls past must not get stuck here: the wheel zooms once the view is in use.
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      zoom(Math.exp(-0.0015 * event.deltaY));
    }, { passive: false });
  };

  /** Play: call paint with the phase of the motion while the view is in the page and on screen. */
  const player = (canvas, paint) => {
    const state = { playing: false, phase: 1, seen: true };
    let last = null;
    let angle = 0;
    const tick = (now) => {
      if (!state.playing || !canvas.isConnected || !state.seen) {
        last = null;
        state.running = false;
        return;
      }
      if (last !== null) angle += (2 * Math.PI * Math.min(now - last, 100)) / CYCLE;
      last = now;
      state.phase = Math.cos(angle);
      paint();
      requestAnimationFrame(tick);
    };
    state.go = () => {
      if (state.playing && state.seen && !state.running) {
        state.running = true;
        requestAnimationFrame(tick);
      }
    };
    state.rest = () => {
      angle = 0;
      state.phase = 1;
    };
    new IntersectionObserver((entries) => {
      state.seen = entries[entries.length - 1].isIntersecting;
      state.go();
    }).observe(canvas);
    return state;
  };

  /** Return what is drawn of a picked mode: shape, measured arrows scaled to it, MAC. */
  const picture = (stage, mode, modes) => {
    const shape = mode.predicted ? mode.predicted.shape : null;
    if (!mode.measured) return { shape, arrows: null, mac: null, scored: null };
    const { shape: measured, mode: number, modification } = mode.measured;
    const scored = (modes ?? []).find((item) => item.mode === number && same(item.modification, modification)) ?? null;
    if (!shape) return { shape, arrows: measured, mac: scored && scored.mac, scored };
    const { factor, mac } = bench.scene.match(measured, bench.scene.readings(stage, shape));
    const arrows = measured.map((value) => (value === null ? null : factor * value));
    return { shape, arrows, mac: scored && scored.mac !== null ? scored.mac : mac, scored };
  };

  const legend = () => {
    const item = (kind, text) => bench.el("li", {}, bench.el("span", { class: `case-key ${kind}`, "aria-hidden": "true" }), text);
    return bench.el("ul", { class: "case-legend" }, item("shape", "predicted (thick line)"),
      item("measured", "measured at the sensors (arrow, ring)"), item("still", "undeformed (thin line)"),
      item("attached", "masses, springs, supports"));
  };

  /**
   * Show a structure and its mode shapes in root; returns {pick(name)} to choose the strategy.
   *
   * stage: of the case. exhibits: [{name, exhibit, modes}], one a strategy; exhibit may be null.
   */
  bench.structure = (root, stage, exhibits) => {
    const el = bench.el;
    const shown = (exhibits ?? []).filter((entry) => entry.exhibit);
    const start = { ...(START[stage.plane] ?? START["3d"]), zoom: 1, fit: 1 };
    const view = { ...start };
    const frame = bench.scene.extent(stage.nodes);
    const canvas = el("canvas", { class: "case-canvas case-view", tabindex: "0", role: "application", "aria-roledescription": "structure view" });
    const told = el("p", { class: "case-told", role: "status" });
    const show = { joints: stage.plane !== "matrices", sensors: false, attached: true, measured: true };
    let [entry, modes, at, now, amplitude] = [shown[0] ?? null, [], 0, null, 1];
    let ink = null;
    const paint = () => {
      if (!canvas.clientWidth) return;
      ink = ink ?? colours(canvas);
      bench.scene.draw(canvas, { stage, view, frame, chains, ...now, reach: REACH * amplitude * frame.radius, phase: play.phase, show, colours: ink });
    };
    const chains = bench.scene.chains(stage);
    const play = player(canvas, paint);
    const repaint = () => {
      if (!play.running) paint();
    };
    const describe = (text) => {
      told.textContent = text;
      canvas.setAttribute("aria-label", `Structure in three dimensions. ${text}. ${play.playing ? "Playing" : "Paused"}. ${HELP}`);
    };
    const pickMode = (index) => {
      at = (index + modes.length) % modes.length;
      modeList.value = keyOf(modes[at]);
      now = picture(stage, modes[at], entry && entry.modes);
      describe(sentence(modes[at], entry ? entry.name : "", now.mac, now.scored));
      repaint();
    };
    const pickStrategy = (name) => {
      const key = modes.length ? keyOf(modes[at]) : "";
      entry = shown.find((item) => item.name === name) ?? entry;
      if (entry) strategyList.value = entry.name;
      modes = modesOf(stage, entry);
      fillModes(modeList, modes);
      if (modes.length) return pickMode(Math.max(modes.findIndex((mode) => keyOf(mode) === key), 0));
      now = { shape: null, arrows: null };
      describe("No modes are stored");
      repaint();
    };
    const step = (by) => modes.length && pickMode(at + by);
    const turn = (azimuth, elevation) => {
      view.azimuth += azimuth;
      view.elevation = Math.min(Math.max(view.elevation + elevation, -90), 90);
      repaint();
    };
    const zoom = (factor) => {
      view.zoom = Math.min(Math.max(view.zoom * factor, 0.3), 12);
      repaint();
    };
    const toggle = () => {
      play.playing = !play.playing;
      playButton.textContent = play.playing ? "Pause" : "Play";
      describe(told.textContent);
      play.go();
    };
    const reset = () => {
      Object.assign(view, { ...start, fit: view.fit });
      play.rest();
      repaint();
    };
    const [modeField, modeList] = choice("Mode", [], (key) => pickMode(modes.findIndex((mode) => keyOf(mode) === key)));
    const [strategyField, strategyList] = choice("Strategy", shown.map((item) => option(item.name, item.name)), pickStrategy);
    strategyList.disabled = shown.length === 0;
    const playButton = bench.el("button", { type: "button", class: "case-button case-play" }, "Play");
    playButton.addEventListener("click", toggle);
    const slider = el("input", { type: "range", min: "0", max: "3", step: "0.1", value: "1" });
    slider.addEventListener("input", () => {
      amplitude = Number(slider.value);
      repaint();
    });
    const keys = {
      ArrowLeft: () => turn(6, 0), ArrowRight: () => turn(-6, 0), ArrowUp: () => turn(0, 6), ArrowDown: () => turn(0, -6),
      "+": () => zoom(1.15), "=": () => zoom(1.15), "-": () => zoom(1 / 1.15), r: reset, n: () => step(1), p: () => step(-1), " ": toggle,
    };
    canvas.addEventListener("keydown", (event) => {
      const act = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
    });
    listen(canvas, turn, zoom);
    const flip = (name) => (on) => {
      show[name] = on;
      repaint();
    };
    root.append(el("div", { class: "case-structure" },
      el("div", { class: "case-controls" }, strategyField, modeField,
        el("span", { class: "case-group" }, button("Previous mode (P)", "\u2039", () => step(-1)), playButton, button("Next mode (N)", "\u203a", () => step(1))),
        el("label", { class: "case-field" }, "Amplitude ", slider)),
      canvas, told,
      el("div", { class: "case-controls" },
        el("span", { class: "case-group", role: "group", "aria-label": "View" },
          button("Turn left", "\u2190", keys.ArrowLeft), button("Turn right", "\u2192", keys.ArrowRight), button("Tilt up", "\u2191", keys.ArrowUp),
          button("Tilt down", "\u2193", keys.ArrowDown), button("Zoom in (+)", "+", keys["+"]), button("Zoom out (-)", "\u2212", keys["-"]), button("Reset the view (R)", "Reset", reset)),
        check("Joints", show.joints, flip("joints")), check("Sensors", show.sensors, flip("sensors")),
        check("Attachments", show.attached, flip("attached")), check("Measured", show.measured, flip("measured"))),
      legend(), el("p", { class: "case-hint" }, HELP)));
    pickStrategy(shown[0] ? shown[0].name : "");
    new ResizeObserver(() => {
      if (!canvas.clientWidth) return;
      view.fit = bench.scene.fit(start, frame, stage, REACH * frame.radius, canvas.clientWidth, canvas.clientHeight);
      ink = null;
      repaint();
    }).observe(canvas);
    bench.heat.whenColoursChange(canvas, () => {
      ink = null;
      repaint();
    });
    if (shown.length && !matchMedia("(prefers-reduced-motion: reduce)").matches) toggle();
    return { pick: pickStrategy };
  };
}
