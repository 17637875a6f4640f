// A recorded run: the whole of it above, a part of it below, and what was at the moment chosen.
'use strict';

const SPANS = [0.01, 0.1, 1, 2, 10, 60, 600, 3600];
const run = {at: 0, span: 2, busy: false, again: false, path: []};

function takeRun(news) {
  if (news.run) {
    const {name, begin, end, state, version} = news.run;
    $('run-name').textContent = `Recorded run ${name}`;
    Object.assign($('at'), {min: begin, max: end});
    if (!run.begun) {
      $('span').replaceChildren(...SPANS.filter(s => s < end - begin).map(s => new Option(`${s} s`, s)), new Option('all', end - begin));
      run.span = Number($('span').value = String(SPANS.filter(s => s <= 2 && s < end - begin).pop() ?? end - begin));
      Object.assign(run, {begun: true, at: end});
    }
    if (version !== run.version) {
      run.version = version;
      view('overview', begin, end).then(() => look(run.at));
    }
    run.state = state;
  }
  if ('reading' in news) run.reading = news.reading;
  $('run-state').textContent = [run.state, run.reading == null ? '' : `Read so far: ${(run.reading * 100).toFixed(0)} %.`].join(' ');
  if (news.path) run.path = news.path;
  if (news.events) {
    $('log').replaceChildren(...news.events.map(([time, text]) => {
      const item = document.createElement('li'), button = document.createElement('button');
      button.type = 'button';
      button.textContent = `${time.toFixed(3)} s: ${text}`;
      button.onclick = () => look(time);
      item.append(button);
      return item;
    }));
    look(run.at);
  }
}

function view(plot, from, to) {
  return ask({do: 'view', plot, from, to});
}

// One request at a time, and then the newest: a slider that is drawn does not wait for old pictures.
async function look(at, span = run.span) {
  Object.assign(run, {at, span});
  trail = run.path.filter(([time], k) => k === 0 || time <= at).map(([, speed, depth]) => ({speed, depth}));
  $('at').value = at;
  $('at').setAttribute('aria-valuetext', `${at.toFixed(2)} s`);
  plots.get('overview')?.redraw(false);
  $('at-text').value = `${at.toFixed(span < 0.2 ? 4 : 2)} s`;
  run.again = true;
  if (run.busy) return;
  run.busy = true;
  while (run.again) {
    run.again = false;
    await Promise.all([view('part', run.at - run.span, run.at), ask({do: 'at', time: run.at})]);
  }
  run.busy = false;
}

function takeView({from, to, plot}, {times, values}) {
  const n = times.length, column = s => {
    const factor = s % 2 ? MILLI : MICRO, list = [];
    for (let k = 0; k < n; k++) list.push(values[k * 4 + s] * factor, values[(n + k) * 4 + s] * factor);
    return list;
  };
  const x = [];
  times.forEach((t, k) => {
    const next = k + 1 < n ? times[k + 1] : t;
    x.push(from + t, from + (t + next) / 2);
  });
  const select = (begin, end) => look(end, end - begin);
  if (plot === 'overview') {
    drawSignals('overview', 'displacement', x, [column(0), column(2)], 130, select);
    Object.assign(plots.get('overview') ?? {}, {mark: markMoment}).redraw?.(false);
    return;
  }
  drawSignals('displacement-0', 'displacement', x, [column(0), column(2)], 220, select);
  drawSignals('velocity-0', 'velocity', x, [column(1), column(3)], 220, select);
  $('clock').textContent = `${to.toFixed(3)} s`;
}

// The moment in the overview; and its slider, as wide as the axis above it.
function markMoment(u) {
  clip(u);
  u.ctx.lineWidth = 2 * devicePixelRatio;
  upright(u, run.at, 'ink', '');
  u.ctx.restore();
  const {left, width} = u.bbox, half = 8;
  $('at').style.marginLeft = `${left / devicePixelRatio - half}px`;
  $('at').style.width = `${width / devicePixelRatio + 2 * half}px`;
}

$('at').oninput = () => look(Number($('at').value));
$('span').onchange = () => look(run.at, Number($('span').value));
