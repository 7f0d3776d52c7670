// SPDX-License-Identifier: MIT
//
// The force of the last five seconds.
import uPlot from 'uplot';

const seconds = 5, every = 10;  // one sample in ten ticks

export class Plot {
    constructor(element) {
        this.times = [];
        this.forces = [];
        const ink = getComputedStyle(document.body).getPropertyValue('--soft');
        const axis = { stroke: ink, grid: { stroke: `${ink}33`, width: 1 }, ticks: { show: false } };
        this.plot = new uPlot({
            width: element.clientWidth, height: 130, cursor: { show: false }, legend: { show: false },
            scales: { x: { time: false }, y: { range: (_, low, high) => [0, Math.max(10, 1.1 * high)] } },
            axes: [{ ...axis, show: false }, { ...axis, size: 38 }],
            series: [{}, { stroke: getComputedStyle(document.body).getPropertyValue('--accent'), width: 1.5 }],
        }, [[], []], element);
        addEventListener('resize', () => this.plot.setSize({ width: element.clientWidth, height: 130 }));
    }

    add(time, forces) {
        for (let i = (forces.length - 1) % every; i < forces.length; i += every) {
            this.times.push(time - 1e-3 * (forces.length - 1 - i));
            this.forces.push(1e3 * forces[i]);
        }
        const first = this.times.findIndex((t) => t > time - seconds);
        this.times.splice(0, first);
        this.forces.splice(0, first);
        this.plot.setData([this.times, this.forces]);
        this.plot.setScale('x', { min: time - seconds, max: time });
    }

    clear() {
        this.times = [];
        this.forces = [];
    }
}
