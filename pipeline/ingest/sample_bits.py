"""Pictures with samples of 16 bits: how many bits of them a camera fills."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from pipeline.core.errors import UndecodableImage
from pipeline.core.records import RawLayout, Severity
from pipeline.images.raw import has_wide_samples, samples
from pipeline.images.wide_png import is_wide_png, wide_png
from pipeline.mcap_file.reader import RawMessage
from pipeline.messages.content import EncodedImage

# How many bits of a sample of 16 a sensor's converter fills.
SAMPLE_BITS = (10, 12, 14, 16)

Tell = Callable[[Severity, str, str, RawMessage], None]


class SampleBits:
    """The used bits of each topic, by the brightest of its pictures so far."""

    def __init__(self, tell: Tell, most_pixels: int) -> None:
        self._tell = tell
        self._most_pixels = most_pixels
        self._known: dict[str, int] = {}

    def told(self, image: EncodedImage, raw: RawMessage) -> EncodedImage:
        """Return a picture with the bits of its samples; as it is, if these have 8 bits.

        A PNG of 16 bits becomes bare samples: OpenCV takes all of them as filled, so that the pictures
        of a camera of 12 bits were nearly black.
        """
        try:
            if image.layout is None and is_wide_png(image.data):
                data, layout = wide_png(image.data, self._most_pixels)
                image = replace(image, data=data, layout=layout)
            if image.layout is None or not has_wide_samples(image.layout.encoding):
                return image
            return self._with_bits(image, image.layout, raw)
        except UndecodableImage:
            return image  # it is reported when its turn comes

    def _with_bits(self, image: EncodedImage, layout: RawLayout, raw: RawMessage) -> EncodedImage:
        topic = raw.channel.topic
        known = self._known.get(topic, 0)
        largest = int(samples(image.data, layout).max(initial=0))
        bits = max(known, next(b for b in SAMPLE_BITS if largest < 1 << b))
        if bits != known:
            self._known[topic] = bits
            if known or bits < SAMPLE_BITS[-1]:
                text = f"from here on samples of 16 bits are taken as {bits} bits"
                self._tell(Severity.INFO, "assumed_bit_depth", text, raw)
        return replace(image, layout=replace(layout, bits=bits))
