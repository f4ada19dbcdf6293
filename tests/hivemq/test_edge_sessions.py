"""The session tests of the edge node, at HiveMQ: what is imported is run here with the broker of this folder."""

from tests.sparkplug.conformance.test_edge_wire import (
    lives,
    test_a_cut_connection_makes_the_broker_publish_the_death_with_the_bdseq_of_the_birth,
    test_a_message_that_the_network_cut_in_two_is_followed_by_a_whole_new_birth,
    test_a_restarted_program_goes_on_with_the_next_bdseq,
    test_after_the_connack_come_the_subscriptions_and_then_the_births,
    test_different_nodes_and_hosts_have_different_client_ids,
    test_each_connect_has_the_next_bdseq_and_the_births_on_it_repeat_it,
    test_everything_but_the_death_of_the_node_goes_with_qos_0_and_nothing_is_retained,
    test_the_sequence_numbers_go_up_in_the_order_of_the_wire,
    test_the_will_stands_in_the_connect,
    test_with_mqtt_5_the_disconnect_asks_for_the_will_too,
    test_with_mqtt_311_the_death_goes_directly_before_the_disconnect,
    test_with_mqtt_311_the_session_is_clean,
)

__all__ = [
    "lives",
    "test_a_cut_connection_makes_the_broker_publish_the_death_with_the_bdseq_of_the_birth",
    "test_a_message_that_the_network_cut_in_two_is_followed_by_a_whole_new_birth",
    "test_a_restarted_program_goes_on_with_the_next_bdseq",
    "test_after_the_connack_come_the_subscriptions_and_then_the_births",
    "test_different_nodes_and_hosts_have_different_client_ids",
    "test_each_connect_has_the_next_bdseq_and_the_births_on_it_repeat_it",
    "test_everything_but_the_death_of_the_node_goes_with_qos_0_and_nothing_is_retained",
    "test_the_sequence_numbers_go_up_in_the_order_of_the_wire",
    "test_the_will_stands_in_the_connect",
    "test_with_mqtt_5_the_disconnect_asks_for_the_will_too",
    "test_with_mqtt_311_the_death_goes_directly_before_the_disconnect",
    "test_with_mqtt_311_the_session_is_clean",
]
