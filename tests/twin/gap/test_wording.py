"""Effects in the words of the shop floor."""

from twin.gap.wording import effect_words


def test_an_effect_says_what_it_is_on() -> None:
    assert effect_words("gravity", "z") == "a constant force pulls on Z"
    assert effect_words("sensor_lag", "spindle_temp_c") == "the spindle temperature is read by a slow sensor"
    assert effect_words("runout", "3") == "the tool runs out"
