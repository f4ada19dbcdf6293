/* A stand-in for the vendor's FOCAS library: the same calls, the same structures, a control that does not exist.

   It reads the file that STUB_FWLIB names before each call: lines "<function> <code>", where the code is a return code, "hang" or
   "abort". It writes the names of the calls made to the file that STUB_FWLIB_CALLS names. Only calls that read are here. */

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef struct { int16_t addinfo, max_axis; char cnc_type[2], mt_type[2], series[4], version[4], axes[2]; } ODBSYS;
typedef struct { int16_t hdck, tmmode, aut, run, motion, mstb, emergency, alarm, edit; } ODBST;
typedef struct {
    int16_t dummy, axis;
    int32_t alarm, prgnum, prgmnum, seqnum, actf, acts;
    struct { int32_t absolute, machine, relative, distance; } oaxis;
} ODBDY2;
typedef struct { int32_t data; int16_t dec, unit, disp; char name, suff; } SPEEDELM;
typedef struct { SPEEDELM actf, acts; } ODBSPEED;
typedef struct { int32_t data; int16_t dec, unit; char name, suff1, suff2, reserve; } LOADELM;
typedef struct { LOADELM svload; } ODBSVLOAD;
typedef struct { LOADELM spload, spspeed; } ODBSPLOAD;
typedef struct { int16_t datano, type; int32_t data[4]; } ODBACT2;
typedef struct { int16_t dummy[2]; int32_t data; } ODBACT;
typedef struct { int32_t alm_no; int16_t type, axis, dummy, msg_len; char alm_msg[64]; } ODBALMMSG2;
typedef struct { char name[36]; int32_t o_num; } ODBEXEPRG;
typedef struct { int16_t datano, type; union { struct { int32_t aux_data; char flag1, flag2; } aux; } modal; } ODBMDL;
typedef struct { int16_t group, flag; char code[8]; } ODBGCD;
typedef struct { int16_t datano, type; int32_t data; } ODBTLIFE4;
typedef struct { int16_t datano, type; int32_t data; } ODBTOFS;
typedef struct {
    int16_t type, dummy;
    union { struct { int16_t year, month, date; } date; struct { int16_t hour, minute, second; } time; } data;
} IODBTIMER;
typedef struct { char name, suff; } ODBAXISNAME;
typedef struct { int16_t type_a, type_d, datano_s, datano_e; union { char cdata[5]; } u; } IODBPMC;
typedef struct { int16_t datano, dummy; int32_t mcr_val; int16_t dec_val; } ODBM;
typedef struct { int16_t datano, type, char_num; char data[256]; } OPMSG;
typedef struct {
    int32_t number, length, page;
    char comment[52];
    struct { int16_t year, month, day, hour, minute, dummy; } mdate, cdate;
} PRGDIR3;
typedef struct { int16_t datano, type; int32_t next, use, slct; } ODBUSEGR;
typedef struct { int16_t datano, type; int32_t data; } ODBTLIFE3;
typedef struct {
    int16_t dummy, alm_grp, alm_no;
    char axis_no, year, month, day, hour, minute, second, dummy2;
    int16_t len_msg;
    char alm_msg[32];
} ALM_HIS;
typedef struct { uint16_t s_no; int16_t type; uint16_t e_no; ALM_HIS alm_his[10]; } ODBAHIS;

static const int32_t MACHINE[3] = {-399311, -248315, -386000};
static const char AXES[4] = "XYZ";

/* What the file says of this function; 0 where it says nothing. */
static int16_t told(const char *function) {
    char line[128], name[64], what[32];
    const char *path = getenv("STUB_FWLIB"), *calls = getenv("STUB_FWLIB_CALLS");
    int16_t code = 0;
    FILE *file = calls ? fopen(calls, "a") : NULL;
    if (file) { fprintf(file, "%s\n", function); fclose(file); }
    file = path ? fopen(path, "r") : NULL;
    if (!file) return 0;
    while (fgets(line, sizeof line, file)) {
        if (sscanf(line, "%63s %31s", name, what) != 2 || strcmp(name, function) != 0) continue;
        if (strcmp(what, "hang") == 0) sleep(600);
        if (strcmp(what, "abort") == 0) abort();
        code = (int16_t)atoi(what);
    }
    fclose(file);
    return code;
}
#define TOLD(function) do { int16_t code_ = told(function); if (code_) return code_; } while (0)

int16_t cnc_startupprocess(int32_t level, const char *log) { (void)level; (void)log; TOLD("cnc_startupprocess"); return 0; }
int16_t cnc_allclibhndl3(const char *host, uint16_t port, long seconds, uint16_t *handle) {
    TOLD("cnc_allclibhndl3");
    if (!host || port == 0 || seconds <= 0) return 9;
    puts("noise of a library on its standard output");
    *handle = 7;
    return 0;
}
int16_t cnc_freelibhndl(uint16_t h) { TOLD("cnc_freelibhndl"); return h == 7 ? 0 : -8; }
int16_t cnc_setpath(uint16_t h, int16_t path) { TOLD("cnc_setpath"); return h == 7 && path <= 2 ? 0 : 11; }
int16_t cnc_sysinfo(uint16_t h, ODBSYS *out) {
    (void)h; TOLD("cnc_sysinfo");
    memset(out, 0, sizeof *out);
    out->max_axis = 32;
    memcpy(out->cnc_type, "31", 2); memcpy(out->mt_type, " M", 2); memcpy(out->series, "G421", 4);
    memcpy(out->version, "40.1", 4); memcpy(out->axes, "03", 2);
    return 0;
}
int16_t cnc_statinfo(uint16_t h, ODBST *out) {
    (void)h; TOLD("cnc_statinfo");
    memset(out, 0, sizeof *out);
    out->aut = 1; out->run = 3; out->motion = 1; out->mstb = 1;
    return 0;
}
int16_t cnc_rdaxisname(uint16_t h, int16_t *count, ODBAXISNAME *out) {
    (void)h; TOLD("cnc_rdaxisname");
    if (*count < 3) return 2;
    for (*count = 0; *count < 3; ++*count) { out[*count].name = AXES[*count]; out[*count].suff = 0; }
    return 0;
}
int16_t cnc_getfigure(uint16_t h, int16_t type, int16_t *valid, int16_t *in, int16_t *out) {
    (void)h; (void)type; TOLD("cnc_getfigure");
    *valid = 3;
    for (int at = 0; at < 3; ++at) in[at] = out[at] = 3;
    return 0;
}
int16_t cnc_rddynamic2(uint16_t h, int16_t axis, int16_t length, ODBDY2 *out) {
    (void)h; TOLD("cnc_rddynamic2");
    if (length != 44 || sizeof *out != 44) return 2;
    if (axis < 1 || axis > 3) return 4;
    memset(out, 0, sizeof *out);
    out->axis = axis; out->prgnum = 9001; out->prgmnum = 1701; out->seqnum = 144; out->actf = 3200; out->acts = 8500;
    out->oaxis.absolute = 1; out->oaxis.machine = MACHINE[axis - 1]; out->oaxis.relative = 2; out->oaxis.distance = 3;
    return 0;
}
int16_t cnc_rdspeed(uint16_t h, int16_t type, ODBSPEED *out) {
    (void)h; TOLD("cnc_rdspeed");
    if (type != -1) return 4;
    memset(out, 0, sizeof *out);
    out->actf.data = 32005; out->actf.dec = 1; out->acts.data = 8500;
    return 0;
}
int16_t cnc_acts(uint16_t h, ODBACT *out) { (void)h; TOLD("cnc_acts"); memset(out, 0, sizeof *out); out->data = 8501; return 0; }
int16_t cnc_acts2(uint16_t h, int16_t spindle, ODBACT2 *out) {
    (void)h; TOLD("cnc_acts2");
    memset(out, 0, sizeof *out);
    out->datano = spindle; out->data[0] = 8502;
    return 0;
}
int16_t cnc_rdsvmeter(uint16_t h, int16_t *count, ODBSVLOAD *out) {
    (void)h; TOLD("cnc_rdsvmeter");
    if (*count < 3) return 2;
    for (*count = 0; *count < 3; ++*count) {
        memset(&out[*count], 0, sizeof *out);
        out[*count].svload.data = 10 * *count - 5; out[*count].svload.name = AXES[*count];
    }
    return 0;
}
int16_t cnc_rdspmeter(uint16_t h, int16_t type, int16_t *count, ODBSPLOAD *out) {
    (void)h; TOLD("cnc_rdspmeter");
    if (type != -1) return 4;
    memset(out, 0, sizeof *out);
    out->spload.data = 115; out->spload.dec = 1; out->spspeed.data = 8500; *count = 1;
    return 0;
}
int16_t cnc_rdexecprog(uint16_t h, uint16_t *length, int16_t *block, char *out) {
    const char *text = "T2 M6\nG0 X1.\nM30\n";
    (void)h; TOLD("cnc_rdexecprog");
    if (*length > strlen(text)) *length = (uint16_t)strlen(text);
    memcpy(out, text, *length); *block = 3;
    return 0;
}
int16_t cnc_exeprgname(uint16_t h, ODBEXEPRG *out) {
    (void)h; TOLD("cnc_exeprgname");
    memset(out, 0, sizeof *out); strcpy(out->name, "O9001"); out->o_num = 9001;
    return 0;
}
int16_t cnc_modal(uint16_t h, int16_t type, int16_t block, ODBMDL *out) {
    (void)h; TOLD("cnc_modal");
    if (block != 0 || type < 100 || type > 126) return 3;
    memset(out, 0, sizeof *out);
    out->datano = type; out->modal.aux.aux_data = type == 106 ? 6 : type == 108 ? 2 : type == 107 ? 8500 : type == 104 ? 17 : type == 101 ? 27 : 3000;
    return 0;
}
int16_t cnc_rdgcode(uint16_t h, int16_t group, int16_t block, int16_t *count, ODBGCD *out) {
    (void)h; (void)block; TOLD("cnc_rdgcode");
    memset(out, 0, sizeof *out); out->group = group; *count = 1;
    strcpy(out->code, group == 0 ? "G1" : group == 1 ? "G17" : "G90");
    return 0;
}
int16_t cnc_toolnum(uint16_t h, int16_t group, int16_t use, ODBTLIFE4 *out) {
    (void)h; (void)group; (void)use; TOLD("cnc_toolnum");
    memset(out, 0, sizeof *out); out->data = 12;
    return 0;
}
int16_t cnc_rdtofs(uint16_t h, int16_t number, int16_t type, int16_t length, ODBTOFS *out) {
    (void)h; TOLD("cnc_rdtofs");
    if (length != 8) return 2;
    if (number < 1 || type < 0 || type > 3) return 4;
    out->datano = number; out->type = type; out->data = 101250;
    return 0;
}
int16_t cnc_rdalmmsg2(uint16_t h, int16_t type, int16_t *count, ODBALMMSG2 *out) {
    (void)h; (void)type; TOLD("cnc_rdalmmsg2");
    memset(out, 0, sizeof *out);
    out->alm_no = 401; out->type = 6; out->msg_len = 11; memcpy(out->alm_msg, "SERVO ALARM and junk", 20); *count = 1;
    return 0;
}
int16_t cnc_gettimer(uint16_t h, IODBTIMER *timer) {
    (void)h; TOLD("cnc_gettimer");
    if (timer->type == 0) { timer->data.date.year = 2026; timer->data.date.month = 5; timer->data.date.date = 14; }
    else { timer->data.time.hour = 9; timer->data.time.minute = 30; timer->data.time.second = 15; }
    return 0;
}
int16_t pmc_rdpmcrng(uint16_t h, int16_t area, int16_t kind, uint16_t from, uint16_t to, uint16_t length, IODBPMC *out) {
    (void)h; TOLD("pmc_rdpmcrng");
    if (kind != 0 || to < from || to - from > 3 || length != 8 + 1 + to - from) return 2;
    memset(out, 0, sizeof *out);
    out->type_a = area; out->datano_s = (int16_t)from; out->datano_e = (int16_t)to;
    if (area == 0) out->u.cdata[0] = (char)(from == 12 ? 155 : from == 14 ? 0 : from == 30 ? 120 : 0);
    if (area == 9) { out->u.cdata[0] = (char)0xFE; out->u.cdata[1] = (char)0xFF; }
    if (area == 1) out->u.cdata[0] = (char)(from == 7 ? 1 : from == 10 ? 6 : 0);
    return 0;
}
int16_t cnc_rdmacro(uint16_t h, int16_t number, int16_t length, ODBM *out) {
    (void)h; TOLD("cnc_rdmacro");
    if (length != 10) return 2;
    memset(out, 0, sizeof *out);
    out->datano = number;
    if (number == 500) { out->mcr_val = 80125; out->dec_val = 3; } else out->dec_val = -1;
    return 0;
}
int16_t cnc_rdopmsg(uint16_t h, int16_t type, int16_t length, OPMSG *out) {
    (void)h; TOLD("cnc_rdopmsg");
    if (type != 0 || length != 6 + 256 || sizeof *out != 262) return 2;
    memset(out, 0, sizeof *out);
    out->datano = 2001; out->char_num = 13; strcpy(out->data, "CHECK COOLANT and junk");
    return 0;
}
int16_t cnc_rdprogdir3(uint16_t h, int16_t type, int32_t *top, int16_t *count, PRGDIR3 *out) {
    (void)h; TOLD("cnc_rdprogdir3");
    if (type != 1 || *count != 1) return 4;
    memset(out, 0, sizeof *out);
    out->number = *top <= 1701 ? 1701 : 9001; strcpy(out->comment, "BASE PLATE");
    return 0;
}
int16_t cnc_rdusegrpid(uint16_t h, ODBUSEGR *out) {
    const char *none = getenv("STUB_FWLIB_NO_GROUP");
    (void)h; TOLD("cnc_rdusegrpid");
    memset(out, 0, sizeof *out);
    out->next = 4; out->use = none ? 0 : 3; out->slct = 3;
    return 0;
}
int16_t cnc_rdlife(uint16_t h, int16_t group, ODBTLIFE3 *out) {
    (void)h; TOLD("cnc_rdlife");
    if (group != 3) return 3;
    memset(out, 0, sizeof *out); out->datano = group; out->data = 60;
    return 0;
}
int16_t cnc_rdcount(uint16_t h, int16_t group, ODBTLIFE3 *out) {
    (void)h; TOLD("cnc_rdcount");
    if (group != 3) return 3;
    memset(out, 0, sizeof *out); out->datano = group; out->data = 37;
    return 0;
}
int16_t cnc_rdalmhisno(uint16_t h, uint16_t *number) { (void)h; TOLD("cnc_rdalmhisno"); *number = 12; return 0; }
int16_t cnc_rdalmhistry(uint16_t h, uint16_t first, uint16_t last, uint16_t length, ODBAHIS *out) {
    (void)h; TOLD("cnc_rdalmhistry");
    if (first != 3 || last != 12 || length != 6 + 48 * 10 || sizeof *out != 486) return 2;
    memset(out, 0, sizeof *out);
    for (int at = 0; at < 10; ++at) {
        ALM_HIS *one = &out->alm_his[at];
        one->alm_grp = at < 9 ? 4 : 6; one->alm_no = at < 9 ? 500 : 401;
        one->year = 26; one->month = 5; one->day = (char)(at < 9 ? 13 : 14);
        one->hour = (char)(at < 9 ? 22 : 9); one->minute = (char)(at < 9 ? 4 : 30); one->second = (char)(at < 9 ? 5 : 15);
        one->len_msg = (int16_t)(at < 9 ? 13 : 11);
        memcpy(one->alm_msg, at < 9 ? "+X OVERTRAVEL and junk" : "SERVO ALARM and junk", 20);
    }
    return 0;
}
