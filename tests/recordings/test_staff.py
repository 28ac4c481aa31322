"""The recording `staff` is what the paper's tables say, in the file as it is shipped."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader

from pipeline.ingest.dynamic import decoder_for_test if False else None
