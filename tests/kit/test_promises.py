from __future__ import annotations

from pathlib import Path

from tests.promises import Promise, promises


def test_a_promise_is_found_with_its_level_and_its_test(tmp_path: Path) -> None:
    folder = tmp_path / "tests" / "e2e"
    folder.mkdir(parents=True)
    (folder / "test_page.py").write_text("def test_the_page_opens(phone): ...\n")
    (folder.parent / "test_parts.py").write_text(
        "from tests.kit.sizes import in_ci\nfrom tests.server.virtual import virtually\n"
        "@in_ci\n@pytest.mark.realtime\ndef test_it_is_real(): ...\ndef test_it_is_served(): ...\n"
    )
    assert list(promises(tmp_path / "tests")) == [
        Promise("tests/e2e/test_page.py", 1, "the page opens", "browser"),
        Promise("tests/test_parts.py", 5, "it is real", "real, CI"),
        Promise("tests/test_parts.py", 6, "it is served", "app"),
    ]
    assert len(list(promises())) > 1000
