"""The session tests of the host application, at HiveMQ: what is imported is run here with the broker of this folder."""

from tests.sparkplug.conformance.test_host_wire import (
    lives,
    test_a_command_goes_with_qos_0_not_retained_and_without_sequence_number,
    test_after_the_connack_come_the_subscriptions_and_then_the_birth,
    test_news_of_its_own_death_makes_it_say_again_that_it_is_online,
    test_the_birth_says_online_with_the_time_stamp_of_the_will,
    test_the_broker_has_granted_the_subscriptions_before_it_takes_the_birth,
    test_the_death_goes_directly_before_the_disconnect_with_the_present_time,
    test_the_will_stands_in_the_connect_with_the_time_of_the_connect,
    test_with_mqtt_5_the_start_is_clean_and_the_session_ends_with_the_connection,
    test_with_mqtt_311_the_session_is_clean,
)

__all__ = [
    "lives",
    "test_a_command_goes_with_qos_0_not_retained_and_without_sequence_number",
    "test_after_the_connack_come_the_subscriptions_and_then_the_birth",
    "test_news_of_its_own_death_makes_it_say_again_that_it_is_online",
    "test_the_birth_says_online_with_the_time_stamp_of_the_will",
    "test_the_broker_has_granted_the_subscriptions_before_it_takes_the_birth",
    "test_the_death_goes_directly_before_the_disconnect_with_the_present_time",
    "test_the_will_stands_in_the_connect_with_the_time_of_the_connect",
    "test_with_mqtt_5_the_start_is_clean_and_the_session_ends_with_the_connection",
    "test_with_mqtt_311_the_session_is_clean",
]
