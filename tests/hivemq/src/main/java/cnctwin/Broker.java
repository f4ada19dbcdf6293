package cnctwin;

import com.hivemq.embedded.EmbeddedExtension;
import com.hivemq.embedded.EmbeddedHiveMQ;
import java.nio.file.Path;

/**
 * HiveMQ Community Edition in this process, until the standard input ends. Arguments: the folder with config.xml, one for data, and
 * the file with users and roles.
 */
public final class Broker {

    private Broker() {}

    public static void main(final String[] arguments) throws Exception {
        final Path configuration = Path.of(arguments[0]);
        final Path data = Path.of(arguments[1]);
        final EmbeddedExtension rules = EmbeddedExtension.builder()
                .withId("cnctwin-rules")
                .withName("the rules of deploy/hivemq")
                .withVersion("1")
                .withExtensionMain(new Rules(Path.of(arguments[2])))
                .build();
        try (EmbeddedHiveMQ broker = EmbeddedHiveMQ.builder()
                .withConfigurationFolder(configuration)
                .withDataFolder(data)
                .withEmbeddedExtension(rules)
                .build()) {
            broker.start().join();
            System.out.println("ready");
            while (System.in.read() >= 0) {
                // The one who started this process lives.
            }
        }
        System.exit(0);
    }
}
