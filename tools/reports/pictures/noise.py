"""Picture of the Allan deviation of channels, beside that of their processes."""

from collections.abc import Sequence

from ...noise import ChannelNoise
from ...rounding import exactly
from . import BAND, FIRST, INK, MUTED, Drawn, drawn, legend, power_of_ten, sheet


@drawn
def allan_parts_picture(channels: Sequence[ChannelNoise], unit: str) -> Drawn:
    """Draw the Allan deviation of each channel with its intervals, and the band of the fitted processes."""
    figure, (panels,) = sheet(2.9, 1, len(channels), sharey=True)
    for axes, channel in zip(panels, channels, strict=True):
        curve = channel.allan
        axes.set(
            xscale="log", yscale="log", title=f"{channel.channel}: {channel.processes}", xlabel="averaging time [s]"
        )
        axes.fill_between(
            curve.tau_s, curve.model_low, curve.model_high, color=BAND.light, linewidth=0, label="95 % of such records"
        )
        axes.plot(curve.tau_s, curve.model, color=FIRST.light, label="processes")
        axes.vlines(curve.tau_s, curve.low, curve.high, color=MUTED.light, linewidth=0.8)
        axes.plot(
            curve.tau_s, curve.deviation, color=INK.light, linestyle="none", marker="o", markersize=3.0, label="record"
        )
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.xaxis.set_major_formatter(lambda value, _: exactly(value))
        axes.minorticks_off()
    panels[0].set_ylabel(f"Allan deviation [{unit}]")
    legend(figure, 3)
    return figure, f"Allan deviation of {len(channels)} channels with that of their processes"
