/* SPDX-License-Identifier: MIT
   What our adapter needs of the HD interface, declared for the test double (support/hd_double.cpp), under the interface's
   own names and numbers. It is in the place of the vendor's header, which is not ours to give away. */
#pragma once

#define HDCALLBACK

typedef unsigned int HHD;
typedef unsigned int HDenum;
typedef unsigned int HDerror;
typedef int HDint;
typedef double HDdouble;
typedef unsigned short HDushort;
typedef const char* HDstring;
typedef unsigned long HDSchedulerHandle;
typedef unsigned int HDCallbackCode;
typedef HDCallbackCode(HDCALLBACK* HDSchedulerCallback)(void* user);

typedef struct {
    HDerror errorCode;
    int internalErrorCode;
    HHD hHD;
} HDErrorInfo;

#define HD_INVALID_HANDLE 0xFFFFFFFF
#define HD_DEFAULT_SCHEDULER_PRIORITY 32767
#define HD_CALLBACK_DONE 0
#define HD_CALLBACK_CONTINUE 1

#define HD_SUCCESS 0x0000
#define HD_WARM_MOTORS 0x0200
#define HD_EXCEEDED_MAX_FORCE 0x0201
#define HD_EXCEEDED_MAX_FORCE_IMPULSE 0x0202
#define HD_EXCEEDED_MAX_VELOCITY 0x0203
#define HD_FORCE_ERROR 0x0204
#define HD_DEVICE_FAULT 0x0300
#define HD_COMM_ERROR 0x0302
#define HD_TIMER_ERROR 0x0304
#define HD_FRAME_ERROR 0x0402

#define HD_CURRENT_BUTTONS 0x2000
#define HD_CURRENT_POSITION 0x2050
#define HD_CURRENT_VELOCITY 0x2051
#define HD_CURRENT_TRANSFORM 0x2052
#define HD_NOMINAL_MAX_FORCE 0x2603
#define HD_NOMINAL_MAX_CONTINUOUS_FORCE 0x2604
#define HD_MOTOR_TEMPERATURE 0x2605
#define HD_CURRENT_FORCE 0x2700
#define HD_FORCE_OUTPUT 0x4000
#define HD_CALIBRATION_OK 0x5000
#define HD_CALIBRATION_NEEDS_UPDATE 0x5001
#define HD_DEVICE_BUTTON_1 0x01

extern "C" {
HHD hdInitDevice(HDstring name);
void hdDisableDevice(HHD device);
void hdMakeCurrentDevice(HHD device);
void hdEnable(HDenum what);
HDenum hdCheckCalibration();
void hdBeginFrame(HHD device);
void hdEndFrame(HHD device);
void hdGetDoublev(HDenum what, HDdouble* values);
void hdGetIntegerv(HDenum what, HDint* values);
void hdSetDoublev(HDenum what, const HDdouble* values);
void hdStartScheduler();
void hdStopScheduler();
HDSchedulerHandle hdScheduleAsynchronous(HDSchedulerCallback callback, void* user, HDushort priority);
void hdUnschedule(HDSchedulerHandle schedule);
HDErrorInfo hdGetError();
HDstring hdGetErrorString(HDerror error);
}
