"""Files of truth: every form gives the same edges, and what is no truth is refused with a reason."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from pipeline.core.errors import UsageError
from pipeline.truth.formats import read_truth, recognise

# One object in the recording's frames 0 and 2, 20 px wide and 60 tall, its first column at 100, its first
# row at 50: outer edges 99.5, 49.5, 119.5, 109.5.
EDGES = (99.5, 49.5, 119.5, 109.5)
FORMS = {
    "mot": "1,7,101,51,20,60,1,1,1\n3,7,101,51,20,60,1,1,1\n",
    "kitti": "".join(
        f"{frame} 7 Pedestrian 0 0 -1.5 99.5 49.5 119.5 109.5 1.75 0.6 0.8 2.0 1.6 12.5 0.1\n"
        for frame in (0, 2)
    ),
    "cvml": "<dataset>"
    + "".join(
        f'<frame number="{frame}"><objectlist><object id="7"><box h="60" w="20" xc="109.5" yc="79.5"/>'
        "</object></objectlist></frame>"
        for frame in (0, 2)
    )
    + "</dataset>",
    "coco": json.dumps(
        {
            "images": [{"id": 5, "frame_id": 0}, {"id": 6, "frame_id": 2}],
            "categories": [{"id": 1, "name": "person"}],
            "annotations": [
                {
                    "id": n,
                    "image_id": image,
                    "category_id": 1,
                    "track_id": 7,
                    "bbox": [100, 50, 20, 60],
                }
                for n, image in enumerate((5, 6))
            ],
        }
    ),
    "csv": "frame_index,object_id,x_min_px,y_min_px,x_max_px,y_max_px\n"
    "0,7,99.5,49.5,119.5,109.5\n2,7,99.5,49.5,119.5,109.5\n",
}


def written(folder: Path, text: str) -> Path:
    path = folder / "truth.txt"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("form", FORMS)
def test_forms_are_recognised_and_say_the_same(form: str, tmp_path: Path) -> None:
    truth = read_truth(written(tmp_path, FORMS[form]))
    assert truth.form == form == recognise(FORMS[form])
    assert not truth.refused
    assert [row.frame - truth.first_frame for row in truth.objects if row.frame is not None] == [
        0,
        2,
    ]
    for row in truth.objects:
        assert row.object_id == "7"
        assert row.class_name == "person"
        assert row.bbox_xyxy_px == pytest.approx(EDGES)


def test_kitti_tells_depth_and_height_and_regions_without_care(tmp_path: Path) -> None:
    care = "0 -1 DontCare -1 -1 -10 200 50 300 80 -1000 -1000 -1000 -10 -1 -1 -1\n"
    truth = read_truth(written(tmp_path, FORMS["kitti"] + care))
    assert (truth.objects[0].depth_m, truth.objects[0].height_m) == (12.5, 1.75)
    assert [row.bbox_xyxy_px for row in truth.ignored] == [(200.0, 50.0, 300.0, 80.0)]


def test_mot_leaves_out_what_it_does_not_consider(tmp_path: Path) -> None:
    text = "1,1,10,10,20,60,1,1,1\n1,2,50,10,20,60,0,1,1\n1,3,90,10,20,60,1,8,1\n1,4,10,90,40,30,1,3,1\n"
    truth = read_truth(written(tmp_path, text))
    assert [(r.object_id, r.class_name) for r in truth.objects] == [("1", "person"), ("4", "car")]
    assert [r.object_id for r in truth.ignored] == ["2", "3"]


def test_detections_are_no_truth(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="detections, not truth"):
        read_truth(written(tmp_path, "1,-1,10,10,20,60,0.9\n2,-1,10,10,20,60,0.8\n"))


def test_frames_between_are_empty_where_every_frame_is_labelled(tmp_path: Path) -> None:
    rows = "".join(f"{f},1,10,10,20,60,1\n" for f in (1, 2, 3, 6, 7))
    assert read_truth(written(tmp_path, rows)).frames == set(range(1, 8))
    sparse = "".join(f"{f},1,10,10,20,60,1\n" for f in (1, 13, 25, 49))
    assert read_truth(written(tmp_path, sparse)).frames == {1, 13, 25, 37, 49}


def test_a_table_of_heights_and_empty_frames(tmp_path: Path) -> None:
    text = "frame_index,time_s,object_id,height_m,depth_m\n,,anna,1.71,\n4,,,,\n,0.8,anna,,12.5\n"
    truth = read_truth(written(tmp_path, text))
    assert truth.frames == {4}
    assert [(r.frame, r.height_m, r.depth_m, r.time_s) for r in truth.objects] == [
        pytest.approx((None, 1.71, float("nan"), float("nan")), nan_ok=True),
        pytest.approx((None, float("nan"), 12.5, 0.8), nan_ok=True),
    ]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("frame_index,object_id,weight_kg\n0,1,80\n", "unknown column 'weight_kg'"),
        ("frame_index,object_id,x_min_px\n0,1,5\n", "a box has four edges"),
        ("frame_index,object_id,depth_m\n0,1,-3\n", "depth_m -3 is impossible"),
        ("1,1,10,10,0,60,1\n", "is no box"),
        ("<dataset><frame number='0'>", "not valid XML"),
        ("<!DOCTYPE d [<!ENTITY a 'b'>]><dataset/>", "entities"),
        ("{}", "images"),
        ("[1, 2", "not recognised"),
        ("", "not recognised"),
    ],
)
def test_nonsense_is_refused_with_its_reason(text: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=reason):
        read_truth(written(tmp_path, text))


def test_good_lines_beside_bad_ones_are_kept(tmp_path: Path) -> None:
    truth = read_truth(written(tmp_path, FORMS["mot"] + "what is this\n4,7,1e400,1,2,3\n"))
    assert len(truth.objects) == 2
    assert truth.refused[0] == "line 3: it is no row: 'what is this'"
    assert len(truth.refused) == 2


def test_coco_without_identities_says_what_it_cannot_tell(tmp_path: Path) -> None:
    text = (
        FORMS["coco"]
        .replace('"track_id": 7, ', "")
        .replace('"frame_id": 0', '"file_name": "x_010.jpg"')
    )
    truth = read_truth(written(tmp_path, text.replace('"frame_id": 2', '"file_name": "x_012.jpg"')))
    assert len({row.object_id for row in truth.objects}) == 2
    assert truth.first_frame == 10
    assert [d for d in truth.doubts if "IDF1" in d]
