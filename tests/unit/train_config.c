/* Configurations that must be refused, and what the message names. */
#include <stdio.h>
#include <string.h>

#include "lib/lab/train/config.h"
#include "tests/check.h"

static void config_refuse(const char *text, const char *names)
{
    struct train_config c;
    struct error err = {0};
    int rc = train_config_parse(&c, text, "c.json", &err);

    check_error(text, rc == -1 && strstr(err.text, names) && err.code, &err);
    if (!rc)
        train_config_release(&c);
}

int main(void)
{
    struct train_config c;
    struct error err = {0};

    config_refuse("{", "not JSON");
    config_refuse("[]", "object");
    config_refuse("{}", "stage: missing");
    config_refuse("{\"stage\":\"moton\"}", "moton");
    config_refuse("{\"stage\":\"motion\",\"setps\":3}", "setps: unknown");
    config_refuse("{\"stage\":\"motion\",\"loss\":{\"vertx\":3}}",
                  "loss.vertx");
    config_refuse("{\"stage\":\"motion\",\"steps\":-1}", "steps: -1");
    config_refuse("{\"stage\":\"motion\",\"steps\":1.5}", "whole number");
    config_refuse("{\"stage\":\"motion\",\"steps\":\"9\"}",
                  "steps: not a number");
    config_refuse("{\"stage\":\"motion\",\"batch\":8,\"micro\":3}", "divide");
    config_refuse("{\"stage\":\"avatar\",\"image\":100}", "multiple");
    config_refuse("{\"stage\":\"motion\",\"model\":3}", "model: expected");
    config_refuse("{\"stage\":\"motion\",\"loss\":{\"square_landmarks\":1}}",
                  "true or false");
    if (train_config_parse(&c, "{\"stage\":\"motion\",\"steps\":100,"
                           "\"rate\":1.0,\"rate_end\":0.0,\"warmup\":10,"
                           "\"loss\":{\"anchor_end\":0,\"anchor_steps\":50},"
                           "\"model\":{\"motion\":{\"net\":\"x\"}}}",
                           "c.json", &err)) {
        printf("refused: %s\n", err.text);
        return 1;
    }
    expect("rate, first step of the warm-up", train_rate(&c, 0), 0.1, 1e-9);
    expect("rate after the warm-up", train_rate(&c, 10), 1, 1e-9);
    expect("rate half way", train_rate(&c, 55), 0.5, 1e-9);
    expect("rate at the end", train_rate(&c, 100), 0, 1e-9);
    expect("anchor half way", train_anchor(&c, 25), 0.5, 1e-9);
    expect("anchor after its steps", train_anchor(&c, 80), 0, 0);
    train_config_release(&c);
    return check_status();
}
